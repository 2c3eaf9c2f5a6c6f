// SPDX-License-Identifier: Apache-2.0
#include "driftlight/warp.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace driftlight {

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

int DiscreteDistribution::index_of(double u) const {
  assert(total_ > 0);
  // The first entry above u: it ends an interval of positive length that contains u.
  const auto above = std::upper_bound(cumulative_.begin() + 1, cumulative_.end(), u);
  const auto i = static_cast<std::size_t>(above - cumulative_.begin()) - 1;
  return static_cast<int>(std::min(i, cumulative_.size() - 2));
}

}  // namespace driftlight
