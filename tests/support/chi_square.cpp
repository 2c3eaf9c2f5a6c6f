// SPDX-License-Identifier: Apache-2.0
#include "support/chi_square.h"

#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <numeric>

namespace driftlight::test {

ChiSquareResult chi_square(std::span<const double> observed, std::span<const double> expected,
                           double minimum) {
  std::vector<std::size_t> order(expected.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return expected[a] < expected[b]; });
  ChiSquareResult result;
  double pooled_observed = 0;
  double pooled_expected = 0;
  int cells = 0;
  const auto close_cell = [&] {
    const double difference = pooled_observed - pooled_expected;
    result.statistic += difference * difference / pooled_expected;
    ++cells;
    pooled_observed = 0;
    pooled_expected = 0;
  };
  for (const std::size_t i : order) {
    pooled_observed += observed[i];
    pooled_expected += std::max(expected[i], 0.0);
    if (pooled_expected >= minimum) close_cell();
  }
  // What is left over is a small cell; it counts if it stands for something.
  if (pooled_expected > 1.0) close_cell();
  result.degrees = cells - 1;
  if (result.degrees < 1) return result;
  const boost::math::chi_squared distribution(result.degrees);
  result.p_value = boost::math::cdf(boost::math::complement(distribution, result.statistic));
  return result;
}

ChiSquareResult chi_square_uniform(std::span<const double> samples, int cells) {
  std::vector<double> observed(static_cast<std::size_t>(cells));
  for (const double x : samples) {
    const int i = std::clamp(static_cast<int>(std::floor(x * cells)), 0, cells - 1);
    observed[static_cast<std::size_t>(i)] += 1.0;
  }
  const std::vector<double> expected(observed.size(), static_cast<double>(samples.size()) / cells);
  return chi_square(observed, expected);
}

namespace {

/// Nodes and weights of the 4-point Gauss-Legendre rule on [0, 1].
constexpr std::array<double, 4> kNodes{0.069431844202973714, 0.33000947820757187,
                                       0.66999052179242813, 0.93056815579702623};
constexpr std::array<double, 4> kWeights{0.17392742256872693, 0.32607257743127307,
                                         0.32607257743127307, 0.17392742256872693};

double gauss(const std::function<double(double, double)>& f, double x0, double x1, double y0,
             double y1) {
  double sum = 0;
  for (std::size_t i = 0; i < kNodes.size(); ++i)
    for (std::size_t j = 0; j < kNodes.size(); ++j)
      sum += kWeights[i] * kWeights[j] * f(x0 + kNodes[i] * (x1 - x0), y0 + kNodes[j] * (y1 - y0));
  return sum * (x1 - x0) * (y1 - y0);
}

double refine(const std::function<double(double, double)>& f, double x0, double x1, double y0,
              double y1, double whole, double tolerance, int depth) {
  const double x = 0.5 * (x0 + x1);
  const double y = 0.5 * (y0 + y1);
  const std::array<double, 4> parts{gauss(f, x0, x, y0, y), gauss(f, x, x1, y0, y),
                                    gauss(f, x0, x, y, y1), gauss(f, x, x1, y, y1)};
  const double sum = parts[0] + parts[1] + parts[2] + parts[3];
  if (depth <= 1 || std::abs(sum - whole) < tolerance) return sum;
  const double part = 0.5 * tolerance;
  return refine(f, x0, x, y0, y, parts[0], part, depth - 1) +
         refine(f, x, x1, y0, y, parts[1], part, depth - 1) +
         refine(f, x0, x, y, y1, parts[2], part, depth - 1) +
         refine(f, x, x1, y, y1, parts[3], part, depth - 1);
}

}  // namespace

double integrate(const std::function<double(double, double)>& f, double x0, double x1, double y0,
                 double y1, double tolerance, int depth) {
  return refine(f, x0, x1, y0, y1, gauss(f, x0, x1, y0, y1), tolerance, depth);
}

SphereGrid::SphereGrid(const Vec3d& axis, int rings, int sectors, double power)
    : axis_(axis), rings_(rings), sectors_(sectors), power_(power) {}

double SphereGrid::theta(int ring) const {
  return kPi * std::pow(static_cast<double>(ring) / rings_, power_);
}

int SphereGrid::cell(const Vec3d& direction) const {
  const Vec3d local = to_local(direction, axis_);
  // asin keeps small angles exact, which acos does not.
  const double sine = std::hypot(local.x(), local.y());
  const double angle = std::atan2(sine, local.z());
  const int ring = std::clamp(
      static_cast<int>(std::floor(rings_ * std::pow(angle * kInvPi, 1.0 / power_))), 0, rings_ - 1);
  double turn = std::atan2(local.y(), local.x()) * 0.5 * kInvPi;
  if (turn < 0.0) turn += 1.0;
  const int sector = std::clamp(static_cast<int>(std::floor(turn * sectors_)), 0, sectors_ - 1);
  return ring * sectors_ + sector;
}

std::vector<double> SphereGrid::integrate(const std::function<double(const Vec3d&)>& density,
                                          double tolerance) const {
  const TangentBasis basis = tangent_basis(axis_);
  const auto integrand = [&](double angle, double phi) {
    const double sine = std::sin(angle);
    return sine * density(sine * std::cos(phi) * basis.t + sine * std::sin(phi) * basis.b +
                          std::cos(angle) * axis_);
  };
  std::vector<double> result;
  const double step = 2.0 * kPi / sectors_;
  for (int ring = 0; ring < rings_; ++ring)
    for (int sector = 0; sector < sectors_; ++sector)
      result.push_back(test::integrate(integrand, theta(ring), theta(ring + 1), sector * step,
                                       (sector + 1) * step, tolerance));
  return result;
}

ChiSquareResult chi_square_directions(const SphereGrid& grid, int attempts,
                                      const std::function<Vec3d()>& draw,
                                      const std::function<double(const Vec3d&)>& density) {
  std::vector<double> expected = grid.integrate(density);
  double mass = 0;
  for (double& e : expected) {
    mass += e;
    e *= attempts;
  }
  // The last cell is that of lost attempts; a mass above one cannot be hidden in it.
  if (mass > 1.0 + 1e-3) return {mass, 0, 0.0};
  const double lost = std::max(0.0, 1.0 - mass);
  expected.push_back(lost > 1e-5 ? lost * attempts : 1e-5 * attempts);
  std::vector<double> observed(expected.size());
  for (int i = 0; i < attempts; ++i) {
    const Vec3d d = draw();
    const std::size_t cell =
        d.isZero(0.0) ? observed.size() - 1 : static_cast<std::size_t>(grid.cell(d));
    observed[cell] += 1.0;
  }
  return chi_square(observed, expected);
}

}  // namespace driftlight::test
