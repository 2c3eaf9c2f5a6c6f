// SPDX-License-Identifier: Apache-2.0
#include "family_tiles.h"

#include <algorithm>

#include "driftlight/sensor.h"

namespace driftlight {

FamilyTiles::FamilyTiles(int width, int height)
    : width_(width),
      height_(height),
      columns_((width + kSize - 1) / kSize),
      tiles_(static_cast<std::size_t>(columns_) *
             static_cast<std::size_t>((height + kSize - 1) / kSize)) {}

int FamilyTiles::at(const Vec2d& film) const {
  return tile(std::clamp(static_cast<int>(film.x() * width_), 0, width_ - 1),
              std::clamp(static_cast<int>(film.y() * height_), 0, height_ - 1));
}

void FamilyTiles::add(int tile, double sum) {
  Sums& sums = tiles_[static_cast<std::size_t>(tile)];
  sums.first.add(sum);
  sums.squares.add(sum * sum);
}

double FamilyTiles::effective(int x, int y) const {
  const Sums& sums = tiles_[static_cast<std::size_t>(tile(x, y))];
  const double first = sums.first.value();
  const double squares = sums.squares.value();
  return squares > 0.0 ? first * first / squares : 0.0;
}

double FamilyTiles::luminance_of_fewer(double families, const Image& particles) const {
  double sum = 0.0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      if (!(effective(x, y) < families)) continue;
      const float* rgb = particles.pixel(x, y);
      sum += luminance(Rgbd(static_cast<double>(rgb[0]), static_cast<double>(rgb[1]),
                            static_cast<double>(rgb[2])));
    }
  }
  return sum / (static_cast<double>(width_) * static_cast<double>(height_));
}

}  // namespace driftlight
