// SPDX-License-Identifier: Apache-2.0
/// How many independent families of particles each part of an image rests on.
#pragma once

#include <vector>

#include "driftlight/image.h"
#include "driftlight/scalar.h"
#include "exact_sum.h"

namespace driftlight {

/// By tiles of 16 x 16 pixels, with F what all particles of one sample bring to a tile: the number
/// (sum F)^2 / sum F^2 of families of equal size that would be as noisy. The relative standard
/// error of the tile's sum is one over its root.
class FamilyTiles {
 public:
  FamilyTiles(int width, int height);

  /// The tile of film coordinates in [0, 1)^2.
  int at(const Vec2d& film) const;
  /// What one family has brought to a tile. Any thread may call it.
  void add(int tile, double sum);

  /// Of the tile that a pixel is in; 0 if no family has reached it.
  double effective(int x, int y) const;
  /// Mean luminance of `particles` over the image, of tiles with fewer families than this alone.
  double luminance_of_fewer(double families, const Image& particles) const;

 private:
  static constexpr int kSize = 16;

  struct Sums {
    ExactSum first;
    ExactSum squares;
  };

  int tile(int x, int y) const { return (y / kSize) * columns_ + x / kSize; }

  int width_;
  int height_;
  int columns_;
  std::vector<Sums> tiles_;
};

}  // namespace driftlight
