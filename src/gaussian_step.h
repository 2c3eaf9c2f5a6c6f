// SPDX-License-Identifier: Apache-2.0
/// Gaussian steps in primary sample space, from derivatives of log I.
#pragma once

#include <cstdint>

#include "driftlight/options.h"
#include "driftlight/phase_space.h"
#include "driftlight/random.h"

namespace driftlight {

/// Offsets N(m, V diag(s^2) V^T), with V orthogonal; a constructor for each way to find them.
///
/// Numbers are moved modulo 1. An offset d from u to u' has the offset -d from u' to u as its
/// inverse, and (u, d) -> (u', -d) keeps volumes: the ratio of Hastings takes the densities of the
/// two offsets alone, and steps once round a coordinate need no sum over windings.
class GaussianStep {
 public:
  GaussianStep() = default;

  /// N(0, sigma^2 I): where derivatives are not finite.
  static GaussianStep isotropic(int dimension, double sigma);

  /// Li et al. 2015, section 4. Log I is g.q + q^T H q / 2 about the point, H = V diag(l) V^T.
  /// Hamilton's equations with the inverse mass |H|^-1 and a momentum from N(0, |H|) take the
  /// offset 0 in the time T = pi / 2 to one of mean o and variance v along each eigenvector,
  ///   l < 0   o = (1 - cos T) g / |l| = g / |l|     v = sin^2 T / |l| = 1 / |l|
  ///   l > 0   o = (cosh T - 1) g / |l|              v = sinh^2 T / |l|,
  /// g along it too. The product with the prior N(0, sigma^2), which bounds the step, has
  ///   s^2 = 1 / (1 / v + 1 / sigma^2),   m = s^2 o / v.
  /// Both remain finite for l = 0.
  static GaussianStep hamiltonian(const Vector& gradient, const Matrix& hessian, double sigma);

  /// Luan et al. 2020, section 5: a step of the Langevin equation with the diagonal preconditioner
  /// M and the drift of a direction p, N(eps M p / 2, eps M), likewise times the prior.
  static GaussianStep langevin(const Vector& direction, const Vector& preconditioner, double eps,
                               double sigma);

  int dimension() const { return static_cast<int>(mean_.size()); }
  Vector sample(Rng& rng) const;
  double log_density(const Vector& offset) const;

 private:
  bool rotated_ = false;
  Matrix rotation_;   ///< V, if it is not the identity
  Vector mean_;       ///< along the columns of V, as the others
  Vector deviation_;  ///< s
  double log_norm_ = 0;

  void set_norm();
};

/// What a step of GaussianStep::langevin is made from: the direction of its drift, and the squares
/// of gradients by coordinate, whose roots M is the inverse of.
struct GradientMoments {
  Vector direction;
  Vector square;

  GaussianStep step(const LmcOptions& options) const;
};

/// Memory of the gradients at the points of a chain, for GaussianStep::langevin: Adam's moments
/// (Luan et al. 2020, section 5.1).
///
/// A step from u to u' takes both of its Gaussians with the same memory, in which each is a
/// function of its own point: for a fixed memory the step is in detailed balance. The memory itself
/// changes less and less, by w_t = t^-decay of what it would become ("diminishing adaptation",
/// Roberts and Rosenthal 2007), and so does the weight of former gradients in the drift, momentum
/// w_t. What stays as it was for ever is the weight of the point's own gradient in M.
class GradientMemory {
 public:
  /// Of the step at a point of this gradient.
  GradientMoments moments(const Vector& gradient, const LmcOptions& options) const;
  /// The chain has been at a point of this gradient.
  void add(const Vector& gradient, const LmcOptions& options);

  /// The gradient, cut to the length that options allow.
  static Vector bounded(const Vector& gradient, const LmcOptions& options);

 private:
  /// t^-decay, 1 at first.
  double weight(const LmcOptions& options) const;

  std::uint64_t count_ = 0;
  Vector first_;   ///< moment
  Vector second_;  ///< moment of each coordinate
};

}  // namespace driftlight
