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

  /// Adds light that those samples do not know of, cut already: the geometric mean of the
  /// arithmetic and the harmonic mean over the parts of a cell, smoothed. Light b of a pixel,
  /// carried in portions in proportion to m, takes b / m of them, for a squared relative error in
  /// proportion to m / b. The sum of the one times that of the other is least, over pixels of one
  /// m, for m^2 = sum b / sum 1 / b: a few bright pixels do not set it. Nothing, if nothing was
  /// found.
  void add(const std::vector<FilmValue>& found, double samples);

  double operator()(const Vec2d& film) const;
  /// So bright that a film in units of it does not overflow.
  double film_unit() const;

 private:
  double cell(int x, int y) const;

  std::vector<double> cells_;
  bool dark_ = true;  ///< nothing was found
};

}  // namespace driftlight
