// SPDX-License-Identifier: Apache-2.0
/// Derivatives of a path by Jets over all of its coordinates: the plain way, against which the
/// faster one (linearization.h) is proven.
#pragma once

#include "driftlight/phase_space.h"

namespace driftlight {

/// What to differentiate. Nothing that is not asked for is computed.
struct DerivativeRequest {
  bool gradient = true;
  bool constraints = true;
};

struct PathDerivatives {
  /// grad U = -grad log target, over the tangent coordinates of the chart. (d)
  Vector gradient;
  /// Q of (E63.13) with its floor, symmetric positive definite; the lower triangle is set. (d x d)
  Matrix q;

  /// True if all that was computed is finite.
  bool all_finite(const DerivativeRequest& request) const;
};

/// Derivatives at the chart's base point, by ceres::Jet in one pass (or in passes of 8 coordinates
/// for longer paths).
void differentiate(const Scene& scene, const PathTopology& topology, const Chart& chart,
                   const DerivativeRequest& request, PathDerivatives& result);

/// Q at the tangent coordinates `delta` of the same chart, with Jacobians over those coordinates.
void constraint_matrix(const Scene& scene, const PathTopology& topology, const Chart& chart,
                       const Vector& delta, Matrix& q);

/// Floor that keeps Q positive definite: pi^-2 on the diagonal (DESIGN 1.5).
inline constexpr double kConstraintFloor = kInvPi * kInvPi;

}  // namespace driftlight
