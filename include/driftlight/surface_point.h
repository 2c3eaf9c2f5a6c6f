// SPDX-License-Identifier: Apache-2.0
/// What BSDFs need to know of the point of a surface.
#pragma once

#include "driftlight/frame.h"

namespace driftlight {

template <Scalar T>
struct SurfacePoint {
  Vec3<T> n;   ///< unit shading normal
  Vec2<T> uv;  ///< texture coordinates, of BSDFs with textures
  /// A vector P of any length, whose part across n is the tangent, along dp/du: of BSDFs that are
  /// not isotropic.
  Vec3<T> tangent = constant<T>(Vec3d(Vec3d::Zero()));
};

/// Slope of w along the tangent, (s.w) / (n.w) = (P.w / n.w - n.P) / |P - (n.P) n|, of w of any
/// length.
template <Scalar T>
T tangent_slope(const SurfacePoint<T>& at, const Vec3<T>& w) {
  using std::sqrt;
  const T lift = dot(at.n, at.tangent);
  return (dot(at.tangent, w) / dot(at.n, w) - lift) /
         sqrt(dot(at.tangent, at.tangent) - lift * lift);
}

/// The tangent s, and t = n x s.
template <Scalar T>
TangentBasisOf<T> tangent_axes(const SurfacePoint<T>& at) {
  const Vec3<T> s = normalized(along(at.tangent, T(-dot(at.n, at.tangent)), at.n));
  return {s, cross(at.n, s)};
}

}  // namespace driftlight
