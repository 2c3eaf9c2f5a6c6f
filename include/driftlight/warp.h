// SPDX-License-Identifier: Apache-2.0
/// Sampling maps with their densities.
#pragma once

#include <span>
#include <vector>

#include "driftlight/scalar.h"

namespace driftlight {

/// Uniform on the unit sphere, density 1 / (4 pi).
Vec3d square_to_sphere(double u1, double u2);
/// About z, density cos / pi.
Vec3d square_to_cosine_hemisphere(double u1, double u2);
/// About z, density (n + 1) / (2 pi) cos^n.
Vec3d square_to_cosine_power(double u1, double u2, double exponent);
/// Uniform on the unit disk (polar map), density 1 / pi.
Vec2d square_to_disk(double u1, double u2);

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
  /// Draws an index of positive probability and turns u into a fresh number in [0, 1).
  int sample(double& u) const;
  /// The number that `sample` turns into the index i and a fresh number u.
  double inverse(int i, double u) const {
    return cumulative_[static_cast<std::size_t>(i)] + u * probability(i);
  }

 private:
  std::vector<double> cumulative_{0.0};
  double total_ = 0;
};

}  // namespace driftlight
