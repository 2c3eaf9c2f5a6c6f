// SPDX-License-Identifier: Apache-2.0
#include "driftlight/film.h"

#include <algorithm>
#include <cmath>

namespace driftlight {

Film::Film(int width, int height, const ReconstructionFilter& filter)
    : width_(width),
      height_(height),
      weights_(filter, width, height),
      sums_(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

void Film::splat(const Vec2d& film, const Rgbd& color, double weight) {
  if (!weights_.is_pixel())
    return weights_.spread(
        film, [&](std::size_t pixel, double share) { add(pixel, color, weight * share); });
  const int x = std::clamp(static_cast<int>(film.x() * width_), 0, width_ - 1);
  const int y = std::clamp(static_cast<int>(film.y() * height_), 0, height_ - 1);
  add(static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x),
      color, weight);
}

void Film::add(std::size_t pixel, const Rgbd& color, double weight) {
  const std::size_t first = 3 * pixel;
  for (int c = 0; c < 3; ++c) {
    const auto units = static_cast<std::int64_t>(std::llrint(color[c] * weight * kUnit));
    sums_[first + static_cast<std::size_t>(c)].fetch_add(units, std::memory_order_relaxed);
  }
}

Image Film::develop(double scale) const {
  Image image(width_, height_);
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    const auto sum = static_cast<double>(sums_[i].load(std::memory_order_relaxed));
    image.rgb[i] = static_cast<float>(sum / kUnit * scale);
  }
  return image;
}

}  // namespace driftlight
