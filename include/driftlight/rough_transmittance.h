// SPDX-License-Identifier: Apache-2.0
/// How much light passes a rough interface, over all directions.
#pragma once

#include <array>

#include "driftlight/microfacet.h"

namespace driftlight {

/// 1 - int F D G / (4 cos_i) d omega_o by the cosine of incidence: what a rough interface does not
/// reflect in one scattering: a natural cubic spline, whose slope and curvature are continuous, in
/// the basis of B-splines.
class RoughTransmittance {
 public:
  RoughTransmittance() = default;
  /// eta is the index beyond over that on the side of incidence.
  RoughTransmittance(const Microfacets& microfacets, double eta);

  template <Scalar T>
  T eval(const T& cosine) const {
    const Cubic c = cubic(value(cosine));
    const T x = cosine * static_cast<double>(kCells) - c.start;
    return c.a[0] + x * (c.a[1] + x * (c.a[2] + x * c.a[3]));
  }
  /// d eval / d cosine
  double slope(double cosine) const {
    const Cubic c = cubic(cosine);
    const double x = cosine * kCells - c.start;
    return kCells * (c.a[1] + x * (2.0 * c.a[2] + x * 3.0 * c.a[3]));
  }
  /// int eval 2 cos d cos, of diffuse light
  double diffuse() const;

 private:
  static constexpr int kCells = 64;
  struct Cubic {
    std::array<double, 4> a;
    double start;
  };
  Cubic cubic(double cosine) const;

  std::array<double, kCells + 1> table_{};
};

}  // namespace driftlight
