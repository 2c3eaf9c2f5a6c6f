// SPDX-License-Identifier: Apache-2.0
/// Sampling maps with their densities.
#pragma once

#include <span>
#include <vector>

#include "driftlight/scalar.h"

namespace driftlight {

/// Root of what rounding may make negative; there it is 0, without derivatives.
template <Scalar T>
T root_or_zero(const T& x) {
  using std::sqrt;
  return value(x) > 0.0 ? T(sqrt(x)) : constant<T>(0.0);
}

/// (r cos phi, r sin phi), phi = 2 pi u.
template <Scalar T>
Vec2<T> polar(const T& r, const T& u) {
  using std::cos;
  using std::sin;
  const T phi = 2.0 * kPi * u;
  return {r * cos(phi), r * sin(phi)};
}

/// Uniform on the unit sphere, density 1 / (4 pi).
template <Scalar T>
Vec3<T> square_to_sphere(const T& u1, const T& u2) {
  const T z = 1.0 - 2.0 * u1;
  const Vec2<T> xy = polar(root_or_zero(T(1.0 - z * z)), u2);
  return {xy.x(), xy.y(), z};
}
/// About z, density cos / pi.
template <Scalar T>
Vec3<T> square_to_cosine_hemisphere(const T& u1, const T& u2) {
  using std::sqrt;
  const Vec2<T> xy = polar(T(sqrt(u1)), u2);
  return {xy.x(), xy.y(), sqrt(1.0 - u1)};
}
/// About z, density (n + 1) / (2 pi) cos^n.
template <Scalar T>
Vec3<T> square_to_cosine_power(const T& u1, const T& u2, double exponent) {
  T z;
  if constexpr (ScalarTraits<T>::is_jet) {
    using std::exp;
    using std::log;
    z = exp(log(1.0 - u1) * (1.0 / (exponent + 1.0)));
  } else {
    z = std::pow(1.0 - u1, 1.0 / (exponent + 1.0));
  }
  const Vec2<T> xy = polar(root_or_zero(T(1.0 - z * z)), u2);
  return {xy.x(), xy.y(), z};
}
/// Uniform on the unit disk (polar map), density 1 / pi.
template <Scalar T>
Vec2<T> square_to_disk(const T& u1, const T& u2) {
  using std::sqrt;
  return polar(T(sqrt(u1)), u2);
}

// Their inverses, with values in [0, 1].
Vec2d sphere_to_square(const Vec3d& v);
Vec2d cosine_hemisphere_to_square(const Vec3d& v);
Vec2d disk_to_square(const Vec2d& p);

/// A finite distribution by its cumulative sums.
class DiscreteDistribution {
 public:
  DiscreteDistribution() = default;
  /// Weights are non-negative; their sum must be positive and finite to sample.
  explicit DiscreteDistribution(std::span<const double> weights);

  int size() const { return static_cast<int>(cumulative_.size()) - 1; }
  /// Sum of the weights as given.
  double total() const { return total_; }
  double probability(int i) const {
    return cumulative_[static_cast<std::size_t>(i) + 1] - cumulative_[static_cast<std::size_t>(i)];
  }
  /// Draws an index of positive probability and turns u into a fresh number in [0, 1). The index is
  /// a discrete choice, by the value of u.
  template <Scalar T>
  int sample(T& u) const {
    const int i = index_of(value(u));
    u = (u - cumulative_[static_cast<std::size_t>(i)]) / probability(i);
    if (value(u) > 1.0 - 1e-16) u = constant<T>(1.0 - 1e-16);
    return i;
  }
  /// The number that `sample` turns into the index i and a fresh number u.
  double inverse(int i, double u) const {
    return cumulative_[static_cast<std::size_t>(i)] + u * probability(i);
  }

 private:
  int index_of(double u) const;

  std::vector<double> cumulative_{0.0};
  double total_ = 0;
};

}  // namespace driftlight
