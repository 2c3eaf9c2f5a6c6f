// SPDX-License-Identifier: Apache-2.0
/// Scalars of the path contribution: double and ceres::Jet, nested to any depth.
/// This is the only header that includes ceres/jet.h.
#pragma once

#include <ceres/jet.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <concepts>
#include <limits>

namespace driftlight {

template <class T>
struct ScalarTraits {
  static constexpr bool is_scalar = false;
};

template <>
struct ScalarTraits<double> {
  static constexpr bool is_scalar = true;
  static constexpr bool is_jet = false;
  /// The type left when one level of differentiation is taken off.
  using Stripped = double;
};

template <class T, int N>
struct ScalarTraits<ceres::Jet<T, N>> {
  static constexpr bool is_scalar = ScalarTraits<T>::is_scalar;
  static constexpr bool is_jet = true;
  using Stripped = T;
};

/// double, Jet<double, N>, Jet<Jet<double, N>, M>, ..
template <class T>
concept Scalar = ScalarTraits<T>::is_scalar;

template <class T>
using Stripped = typename ScalarTraits<T>::Stripped;

template <class T>
using Vec2 = Eigen::Matrix<T, 2, 1>;
template <class T>
using Vec3 = Eigen::Matrix<T, 3, 1>;
/// Linear sRGB (Rec. 709 primaries, D65 white).
template <class T>
using Rgb = Eigen::Array<T, 3, 1>;

using Vec2d = Vec2<double>;
using Vec3d = Vec3<double>;
using Rgbd = Rgb<double>;

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kInvPi = 1.0 / kPi;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The number behind every level of differentiation.
constexpr double value(double x) { return x; }
template <class T, int N>
double value(const ceres::Jet<T, N>& x) {
  return value(x.a);
}
template <Scalar T>
Vec3d value(const Vec3<T>& v) {
  return {value(v.x()), value(v.y()), value(v.z())};
}
template <Scalar T>
Rgbd value(const Rgb<T>& c) {
  return {value(c.x()), value(c.y()), value(c.z())};
}

/// Takes off one level of differentiation: Jet<T, N> -> T, double -> double.
constexpr double strip(double x) { return x; }
template <class T, int N>
const T& strip(const ceres::Jet<T, N>& x) {
  return x.a;
}

/// A constant of type T: no derivative at any level.
template <Scalar T>
T constant(double k) {
  if constexpr (ScalarTraits<T>::is_jet) {
    return T(constant<Stripped<T>>(k));
  } else {
    return k;
  }
}

template <Scalar T>
Vec2<T> constant(const Vec2d& v) {
  return {constant<T>(v.x()), constant<T>(v.y())};
}
template <Scalar T>
Vec3<T> constant(const Vec3d& v) {
  return {constant<T>(v.x()), constant<T>(v.y()), constant<T>(v.z())};
}
template <Scalar T>
Rgb<T> constant(const Rgbd& c) {
  return {constant<T>(c.x()), constant<T>(c.y()), constant<T>(c.z())};
}

/// True if the value and every derivative are finite.
inline bool all_finite(double x) { return std::isfinite(x); }
template <class T, int N>
bool all_finite(const ceres::Jet<T, N>& x) {
  if (!all_finite(x.a)) return false;
  for (int i = 0; i < N; ++i)
    if (!all_finite(x.v[i])) return false;
  return true;
}

template <Scalar T>
T sqr(const T& x) {
  return x * x;
}

/// Rec. 709 luminance of linear sRGB.
inline const Rgbd kLuminance{0.212671, 0.715160, 0.072169};

template <Scalar T>
T luminance(const Rgb<T>& c) {
  return c.x() * kLuminance.x() + c.y() * kLuminance.y() + c.z() * kLuminance.z();
}

}  // namespace driftlight

// ceres lets a Jet<T, N> meet a T only. These let nested jets meet a plain number, found by
// argument-dependent lookup, so that one spelling serves every Scalar.
namespace ceres {

template <class T, int M, int N>
Jet<Jet<T, M>, N> operator+(const Jet<Jet<T, M>, N>& x, double k) {
  return {x.a + k, x.v};
}
template <class T, int M, int N>
Jet<Jet<T, M>, N> operator+(double k, const Jet<Jet<T, M>, N>& x) {
  return {x.a + k, x.v};
}
template <class T, int M, int N>
Jet<Jet<T, M>, N> operator-(const Jet<Jet<T, M>, N>& x, double k) {
  return {x.a - k, x.v};
}
template <class T, int M, int N>
Jet<Jet<T, M>, N> operator-(double k, const Jet<Jet<T, M>, N>& x) {
  return {k - x.a, -x.v};
}
template <class T, int M, int N>
Jet<Jet<T, M>, N> operator*(const Jet<Jet<T, M>, N>& x, double k) {
  return x * Jet<T, M>(k);
}
template <class T, int M, int N>
Jet<Jet<T, M>, N> operator*(double k, const Jet<Jet<T, M>, N>& x) {
  return x * Jet<T, M>(k);
}
template <class T, int M, int N>
Jet<Jet<T, M>, N> operator/(const Jet<Jet<T, M>, N>& x, double k) {
  return x * Jet<T, M>(1.0 / k);
}
template <class T, int M, int N>
Jet<Jet<T, M>, N> operator/(double k, const Jet<Jet<T, M>, N>& x) {
  return Jet<T, M>(k) / x;
}

}  // namespace ceres
