// SPDX-License-Identifier: Apache-2.0
/// One small step of the Langevin equation and its exact density ([E63] sections 2 to 6).
#pragma once

#include "driftlight/options.h"
#include "driftlight/phase_space.h"
#include "driftlight/random.h"

namespace driftlight {

/// The Gaussian of tangent coordinates that a step from one point draws from:
///   delta = a dt + sqrt(2 dt) T xi,  xi ~ N(0, I)                                    (E63.3)
///   a = -T T* grad U + div(T T*),  T = s c L^-T,  Q = L L^T,  c = 1 / sqrt(6)
///   dt = min(1/3, 2 |T* a|^2 / |a|^4, eps / |(a, grad U)|) / safety, capped          (E63.9)
/// s is the scale of the step, an argument of all that depends on it. [E63] writes |T a| in the
/// time step; the size of the ellipse of T along a is |T* a|, which differs for a Cholesky factor.
/// At dt = 1/3 and s = 1 the random part has covariance Q^-1 / 9.
class StepDistribution {
 public:
  StepDistribution() = default;

  /// Identity preconditioner: Q = I / 9, a step of standard deviation s at dt = 1/3. `gradient` is
  /// null for Drift::None.
  StepDistribution(const KernelOptions& options, int dimension, const Vector* gradient);

  /// From Q (lower triangle). `gradient` is null for Drift::None, `divergence_of_inverse` =
  /// div(Q^-1) is null without it. If Q cannot be factorised, falls back to the identity: a
  /// function of the state, so that the density stays exact.
  StepDistribution(const KernelOptions& options, const Matrix& q, const Vector* gradient,
                   const Vector* divergence_of_inverse);

  int dimension() const { return dimension_; }
  double time_step(double scale) const;
  /// a dt
  Vector mean(double scale) const;
  Vector sample(double scale, Rng& rng) const;
  /// log N(delta; a dt, 2 dt T T*), per unit delta.
  double log_density(const Vector& delta, double scale) const;

 private:
  void set_drift(const KernelOptions& options, const Vector& gradient,
                 const Vector* divergence_of_inverse);
  Vector solve_lower(const Vector& x) const;
  Vector solve_upper(const Vector& x) const;

  int dimension_ = 0;
  bool identity_ = true;
  bool has_drift_ = false;
  Matrix l_;  ///< Cholesky factor; unused for the identity
  double log_det_l_ = 0;
  Vector a_;                ///< drift at scale 1
  double ratio_limit_ = 0;  ///< 2 |T* a|^2 / |a|^4 at scale 1
  double slope_limit_ = 0;  ///< eps / |(a, grad U)| at scale 1
  double safety_ = 1;
  double cap_ = 1;
};

/// The scale of a step: `options.scale`, or log-uniform over `scale_decades` about it. Independent
/// of the state, so each scale is a reversible kernel of its own.
double draw_scale(const KernelOptions& options, Rng& rng);

}  // namespace driftlight
