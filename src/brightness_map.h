// SPDX-License-Identifier: Apache-2.0
/// A smooth guess of how bright each part of the film is.
#pragma once

#include <vector>

#include "driftlight/scalar.h"

namespace driftlight {

/// What one sample adds to the image at a film point.
struct FilmValue {
  Vec2d film;
  double value;  ///< luminance; the mean over all samples of the sums is the mean over the film
};

/// Positive and continuous; bilinear between the centres of square cells.
class BrightnessMap {
 public:
  /// From what `samples` samples, spread evenly over the film, have found. Values far above the
  /// mean are cut, so that rare ones do not mark where they happened to fall; and the result is
  /// smoothed, and kept above a tenth of the mean. 1 everywhere if nothing was found.
  BrightnessMap(const std::vector<FilmValue>& found, double samples);

  double operator()(const Vec2d& film) const;
  double max() const;

 private:
  static constexpr int kCells = 16;  ///< on a side

  static std::size_t index(int x, int y) {
    return static_cast<std::size_t>(y) * kCells + static_cast<std::size_t>(x);
  }
  double& cell(int x, int y) { return cells_[index(x, y)]; }
  double cell(int x, int y) const { return cells_[index(x, y)]; }

  std::vector<double> cells_;
};

}  // namespace driftlight
