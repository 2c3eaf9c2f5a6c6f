// SPDX-License-Identifier: Apache-2.0
/// The film: splats in fixed point, so that their sum does not depend on their order.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "driftlight/image.h"
#include "driftlight/reconstruction_filter.h"
#include "driftlight/scalar.h"

namespace driftlight {

/// Splats are colours of luminance `weight` <= 1 (see Contribution::color), so that a component is
/// at most 14 and 2^28 splats fit a pixel: fewer with filters that are narrower than a pixel.
class Film {
 public:
  Film(int width, int height, const ReconstructionFilter& filter = {});

  /// Adds weight * color at film coordinates in [0, 1)^2. Any thread may call it.
  void splat(const Vec2d& film, const Rgbd& color, double weight);

  /// The sums, times `scale`.
  Image develop(double scale) const;

 private:
  static constexpr double kUnit = 0x1p31;

  void add(std::size_t pixel, const Rgbd& color, double weight);

  int width_;
  int height_;
  FilterWeights weights_;
  std::vector<std::atomic<std::int64_t>> sums_;
};

}  // namespace driftlight
