// SPDX-License-Identifier: Apache-2.0
#include "driftlight/warp.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace driftlight {

Vec3d square_to_sphere(double u1, double u2) {
  const double z = 1.0 - 2.0 * u1;
  const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
  const double phi = 2.0 * kPi * u2;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

Vec3d square_to_cosine_hemisphere(double u1, double u2) {
  const double r = std::sqrt(u1);
  const double phi = 2.0 * kPi * u2;
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(1.0 - u1)};
}

Vec3d square_to_cosine_power(double u1, double u2, double exponent) {
  const double z = std::pow(1.0 - u1, 1.0 / (exponent + 1.0));
  const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
  const double phi = 2.0 * kPi * u2;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

Vec2d square_to_disk(double u1, double u2) {
  const double r = std::sqrt(u1);
  const double phi = 2.0 * kPi * u2;
  return {r * std::cos(phi), r * std::sin(phi)};
}

namespace {

/// Angle of (x, y) in turns, in [0, 1].
double turn(double x, double y) {
  const double turns = 0.5 * kInvPi * std::atan2(y, x);
  return turns < 0.0 ? turns + 1.0 : turns;
}

}  // namespace

Vec2d sphere_to_square(const Vec3d& v) {
  return {std::clamp(0.5 * (1.0 - v.z()), 0.0, 1.0), turn(v.x(), v.y())};
}

Vec2d cosine_hemisphere_to_square(const Vec3d& v) { return disk_to_square(v.head<2>()); }

Vec2d disk_to_square(const Vec2d& p) {
  return {std::min(p.squaredNorm(), 1.0), turn(p.x(), p.y())};
}

DiscreteDistribution::DiscreteDistribution(std::span<const double> weights) {
  cumulative_.reserve(weights.size() + 1);
  double sum = 0;
  for (const double w : weights) cumulative_.push_back(sum += w);
  total_ = sum;
  if (sum > 0)
    for (double& c : cumulative_) c /= sum;
}

int DiscreteDistribution::sample(double& u) const {
  assert(total_ > 0);
  // The first entry above u: it ends an interval of positive length that contains u.
  const auto above = std::upper_bound(cumulative_.begin() + 1, cumulative_.end(), u);
  auto i = static_cast<std::size_t>(above - cumulative_.begin()) - 1;
  i = std::min(i, cumulative_.size() - 2);
  const double width = cumulative_[i + 1] - cumulative_[i];
  u = std::min((u - cumulative_[i]) / width, 1.0 - 1e-16);
  return static_cast<int>(i);
}

}  // namespace driftlight
