// SPDX-License-Identifier: Apache-2.0
/// Gradients that chains have met, for steps at points nearby.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "gaussian_step.h"
#include "primary_path.h"

namespace driftlight {

/// The cache of Luan et al. 2020: the Gaussian at a point is that of the mean moments of the
/// nearest remembered points of its strategy, at most 5 of them, within 0.01 sqrt(d) in d numbers,
/// as in their program. It is a function of the point, and once it is there needs no derivatives.
class GradientCache {
 public:
  /// What a chain knew at a point of the strategy with these numbers.
  struct Point {
    Strategy strategy;
    Vector numbers;
    GradientMoments moments;
  };

  /// Of each strategy the first `options.cache` points.
  GradientCache(const std::vector<Point>& points, const LmcOptions& options);
  GradientCache(GradientCache&&) noexcept;
  ~GradientCache();

  /// N(0, sigma^2) where nothing near is remembered.
  GaussianStep step(const Strategy& strategy, const Vector& numbers) const;

 private:
  class Tree;

  LmcOptions options_;
  std::map<std::pair<int, int>, std::unique_ptr<Tree>> trees_;  ///< by (s, t)
};

}  // namespace driftlight
