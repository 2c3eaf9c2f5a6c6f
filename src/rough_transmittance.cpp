// SPDX-License-Identifier: Apache-2.0
#include "driftlight/rough_transmittance.h"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>

#include "driftlight/fresnel.h"

namespace driftlight {
namespace {

/// int F D G / (4 cos_i) d omega_o, over facets: F G cos_ih / (cos_i cos_h) of D cos_h, which is
/// sampled at the midpoints of a grid of its random numbers.
double reflectance(const Microfacets& m, double eta, double cos_i) {
  const SurfacePoint<double> at{Vec3d::UnitZ(), Vec2d::Zero(), Vec3d::Zero()};
  constexpr int kPolar = 48;
  constexpr int kAround = 48;
  const Vec3d wi(std::sqrt(1.0 - cos_i * cos_i), 0.0, cos_i);
  double sum = 0.0;
  for (int i = 0; i < kPolar; ++i) {
    for (int j = 0; j < kAround; ++j) {
      const Vec3d h = m.sample(at, wi, (i + 0.5) / kPolar, (j + 0.5) / kAround);
      const double ih = wi.dot(h);
      if (ih <= 0.0) continue;
      const Vec3d wo = reflect(wi, h);
      if (wo.z() <= 0.0) continue;
      const double cos_h2 = h.z() * h.z();
      const double d = std::exp(m.log_d(cos_h2, m.steepness(at, h, cos_h2)));
      const double g = m.g1(m.grazing(at, wi, cos_i)) * m.g1(m.grazing(at, wo, wo.z()));
      sum += fresnel_dielectric(ih, eta) * d * g * ih / (cos_i * m.pdf(at, wi, h));
    }
  }
  return sum / (kPolar * kAround);
}

}  // namespace

RoughTransmittance::RoughTransmittance(const Microfacets& microfacets, double eta) {
  constexpr double kGrazing = 1e-4;
  for (int i = 0; i <= kCells; ++i) {
    const double cosine = std::max(kGrazing, static_cast<double>(i) / kCells);
    table_[static_cast<std::size_t>(i)] =
        std::clamp(1.0 - reflectance(microfacets, eta, cosine), 0.0, 1.0);
  }
  // Coefficients c of the spline through these values f: (c_(i-1) + 4 c_i + c_(i+1)) / 6 = f_i, and
  // c = f at the ends, where the curvature is 0. Elimination, then substitution backward.
  std::array<double, kCells> pivots{};
  for (std::size_t i = 1; i < kCells; ++i) {
    pivots[i] = 4.0 - (i > 1 ? 1.0 / pivots[i - 1] : 0.0);
    table_[i] = 6.0 * table_[i] - table_[i - 1] / (i > 1 ? pivots[i - 1] : 1.0);
  }
  for (std::size_t i = kCells - 1; i > 0; --i) table_[i] = (table_[i] - table_[i + 1]) / pivots[i];
}

/// Beyond the ends the coefficients go on straight.
RoughTransmittance::Cubic RoughTransmittance::cubic(double cosine) const {
  // NaN cannot be converted to an integer; in any cell it stays NaN.
  const double place = cosine * kCells;
  const int cell = place > 0.0 ? static_cast<int>(std::min(place, kCells - 1.0)) : 0;
  const auto i = static_cast<std::size_t>(cell);
  const double c1 = table_[i];
  const double c2 = table_[i + 1];
  const double c0 = cell > 0 ? table_[i - 1] : 2.0 * c1 - c2;
  const double c3 = cell + 1 < kCells ? table_[i + 2] : 2.0 * c2 - c1;
  return {{(c0 + 4.0 * c1 + c2) / 6.0, 0.5 * (c2 - c0), 0.5 * (c0 + c2) - c1,
           (c3 - c0) / 6.0 + 0.5 * (c1 - c2)},
          static_cast<double>(cell)};
}

double RoughTransmittance::diffuse() const {
  return boost::math::quadrature::gauss_kronrod<double, 31>::integrate(
      [&](double cosine) { return 2.0 * cosine * eval(cosine); }, 0.0, 1.0);
}

}  // namespace driftlight
