// SPDX-License-Identifier: Apache-2.0
/// float as a Scalar, for Jets in single precision. What a scene holds stays double; a Jet meets it
/// after rounding.
#pragma once

#include "driftlight/scalar.h"

namespace driftlight {

template <>
struct ScalarTraits<float> {
  static constexpr bool is_scalar = true;
  static constexpr bool is_jet = false;
  using Stripped = float;
};

}  // namespace driftlight

namespace ceres {

template <int N>
Jet<float, N> operator+(const Jet<float, N>& x, double k) {
  return x + static_cast<float>(k);
}
template <int N>
Jet<float, N> operator+(double k, const Jet<float, N>& x) {
  return static_cast<float>(k) + x;
}
template <int N>
Jet<float, N> operator-(const Jet<float, N>& x, double k) {
  return x - static_cast<float>(k);
}
template <int N>
Jet<float, N> operator-(double k, const Jet<float, N>& x) {
  return static_cast<float>(k) - x;
}
template <int N>
Jet<float, N> operator*(const Jet<float, N>& x, double k) {
  return x * static_cast<float>(k);
}
template <int N>
Jet<float, N> operator*(double k, const Jet<float, N>& x) {
  return static_cast<float>(k) * x;
}
template <int N>
Jet<float, N> operator/(const Jet<float, N>& x, double k) {
  return x / static_cast<float>(k);
}
template <int N>
Jet<float, N> operator/(double k, const Jet<float, N>& x) {
  return static_cast<float>(k) / x;
}

}  // namespace ceres
