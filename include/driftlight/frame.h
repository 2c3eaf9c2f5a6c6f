// SPDX-License-Identifier: Apache-2.0
/// Directions and small vector geometry, for every Scalar.
#pragma once

#include <array>
#include <cmath>

#include "driftlight/scalar.h"

namespace driftlight {

template <Scalar T>
struct Ray {
  Vec3<T> origin;
  Vec3<T> direction;  ///< unit length
};

/// a . b, written out: one expression for all scalars and no temporaries of Jets.
template <Scalar T>
T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x() * b.x() + a.y() * b.y() + a.z() * b.z();
}
template <Scalar T>
requires(ScalarTraits<T>::is_jet) T dot(const Vec3d& a, const Vec3<T>& b) {
  return a.x() * b.x() + a.y() * b.y() + a.z() * b.z();
}

template <Scalar T>
Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(),
          a.x() * b.y() - a.y() * b.x()};
}

/// p + v t
template <Scalar T>
Vec3<T> along(const Vec3<T>& p, const T& t, const Vec3<T>& v) {
  return {p.x() + t * v.x(), p.y() + t * v.y(), p.z() + t * v.z()};
}

template <Scalar T>
Vec3<T> scaled(const Vec3<T>& v, const T& s) {
  return {v.x() * s, v.y() * s, v.z() * s};
}

template <Scalar T>
Vec3<T> normalized(const Vec3<T>& v) {
  using std::sqrt;
  return scaled(v, constant<T>(1.0) / sqrt(dot(v, v)));
}

/// v / |v|, rounded as Eigen does it.
template <Scalar T>
Vec3<T> unit(const Vec3<T>& v) {
  using std::sqrt;
  const T length = sqrt(dot(v, v));
  return {v.x() / length, v.y() / length, v.z() / length};
}

/// Mirror direction of w about the unit normal n, both leaving the surface: 2 (n.w) n - w.
template <Scalar T>
Vec3<T> reflect(const Vec3<T>& w, const Vec3<T>& n) {
  const T k = 2.0 * dot(n, w);
  return {k * n.x() - w.x(), k * n.y() - w.y(), k * n.z() - w.z()};
}

/// Direction of w refracted at the unit normal n; both w and the result leave the surface.
/// `eta` is the index beyond the surface over the index on the side of w (n may lie on either
/// side). With c = n.w and s = sign(c): wo = -w / eta + (c / eta - s sqrt(1 - (1 - c^2) / eta^2))
/// n. Total internal reflection gives a non-finite result: callers ask fresnel first.
template <Scalar T>
Vec3<T> refract(const Vec3<T>& w, const Vec3<T>& n, double eta) {
  using std::sqrt;
  const double inv = 1.0 / eta;
  const T c = dot(n, w);
  const T root = sqrt(1.0 - (1.0 - c * c) * (inv * inv));
  const T k = value(c) > 0 ? c * inv - root : c * inv + root;
  return {k * n.x() - w.x() * inv, k * n.y() - w.y() * inv, k * n.z() - w.z() * inv};
}

/// Columns t, b completing the unit vector n to a right-handed orthonormal basis (t, b, n).
/// Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017. The sign of n.z
/// chooses between two bases; within each the basis is smooth.
template <Scalar T>
struct TangentBasisOf {
  Vec3<T> t;
  Vec3<T> b;
};
using TangentBasis = TangentBasisOf<double>;

template <Scalar T>
TangentBasisOf<T> tangent_basis(const Vec3<T>& n) {
  const double sign = std::copysign(1.0, value(n.z()));
  const T a = -1.0 / (sign + n.z());
  const T k = n.x() * n.y() * a;
  return {{1.0 + sign * n.x() * n.x() * a, sign * k, -sign * n.x()},
          {k, sign + n.y() * n.y() * a, -n.y()}};
}

/// The direction with coordinates `local` in (t, b, n).
template <Scalar T>
Vec3<T> to_world(const Vec3<T>& local, const Vec3<T>& n) {
  const TangentBasisOf<T> basis = tangent_basis(n);
  return basis.t * local.x() + basis.b * local.y() + n * local.z();
}
template <Scalar T>
Vec3<T> to_local(const Vec3<T>& world, const Vec3<T>& n) {
  const TangentBasisOf<T> basis = tangent_basis(n);
  return {dot(basis.t, world), dot(basis.b, world), dot(n, world)};
}

// Of what converts to vectors of numbers.
inline TangentBasis tangent_basis(const Vec3d& n) { return tangent_basis<double>(n); }
inline Vec3d to_world(const Vec3d& local, const Vec3d& n) { return to_world<double>(local, n); }
inline Vec3d to_local(const Vec3d& world, const Vec3d& n) { return to_local<double>(world, n); }

}  // namespace driftlight
