// SPDX-License-Identifier: Apache-2.0
/// One small step of the Langevin equation and its exact density ([E63] sections 2 to 6).
#pragma once

#include "driftlight/factor.h"
#include "driftlight/options.h"
#include "driftlight/random.h"

namespace driftlight {

/// The Gaussian of tangent coordinates that a step from one point draws from:
///   delta = a dt + sqrt(2 dt) T xi,  xi ~ N(0, I)                                    (E63.3)
///   a = -T T* grad U + div(T T*),  T = s c F^-1,  Q = F^T F,  c = 1 / sqrt(6)
///   dt = min(1/3, 2 |T* a|^2 / |a|^4, eps / |(a, grad U)|) / safety, capped          (E63.9)
/// s is the scale of the step, an argument of all that depends on it. [E63] writes |T a| in the
/// time step; the size of the ellipse of T along a is |T* a|, which differs where T is not
/// symmetric. At dt = 1/3 and s = 1 the random part has covariance Q^-1 / 9.
class StepDistribution {
 public:
  StepDistribution() = default;

  /// `gradient` is null for Drift::None, `divergence_of_inverse` = div(Q^-1) is null without it.
  StepDistribution(const KernelOptions& options, int dimension, const Factor& factor,
                   const Vector* gradient, const Vector* divergence_of_inverse);
  /// The same from a dense Q, or if `precision` is null from the constraints of a path, if it can
  /// be factorised; else from the identity: a function of the state, so that the density stays
  /// exact. False if something is not finite; then there is no distribution.
  bool assign(const KernelOptions& options, const Linearization& path, const Matrix* precision,
              const Vector* divergence_of_inverse);

  int dimension() const { return dimension_; }
  const Factor& factor() const { return factor_; }
  double time_step(double scale) const;
  /// a dt
  Vector mean(double scale) const;
  Vector sample(double scale, Rng& rng) const;
  /// log N(delta; a dt, 2 dt T T*), per unit delta.
  double log_density(const Vector& delta, double scale) const;

 private:
  FactorStatus factorise_step(const Linearization& path, const Matrix* precision);
  /// All that follows from the factor.
  void set(const KernelOptions& options, int dimension, const Vector* gradient,
           const Vector* divergence_of_inverse);
  void set_drift(const KernelOptions& options, const Vector& gradient,
                 const Vector* divergence_of_inverse);

  int dimension_ = 0;
  bool has_drift_ = false;
  Factor factor_;
  double log_det_ = 0;      ///< of the factor
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
