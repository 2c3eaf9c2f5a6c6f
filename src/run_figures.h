// SPDX-License-Identifier: Apache-2.0
/// What independent renders of one scene tell about their integrator, with a reference and without.
#pragma once

#include <vector>

#include "driftlight/image.h"
#include "student.h"

namespace driftlight {

/// Mean luminance of each tile of 8 x 8 pixels, in rows from the top. Tiles at the right and the
/// lower edge may be smaller.
std::vector<double> tile_luminances(const Image& image);

/// The squared error of one image, as two independent ones a and b show it: half of (a - b)^2 has
/// its variance for mean. Figures as those of `Difference`, relMSE relative to an image M of what
/// is expected: mean of (a - b)^2 / 2 / (M^2 + 0.01). With the mean of a and b for M no pixel could
/// be off by more than 2, however heavy.
struct Spread {
  double mse = 0;
  double relmse = 0;
  double relmse_trimmed = 0;  ///< without the 0.1 % of pixels where it is largest
};

/// Of images of the same size.
Spread spread(const Image& a, const Image& b, const Image& expected);

/// The median of each value over all images, of the same size: what is expected where there is no
/// reference, as single heavy samples do not move it. Of at least one image.
Image median_image(const std::vector<const Image*>& images);

/// Student's test of each tile that the mean over runs is the reference's.
struct TileTest {
  int tiles = 0;
  int rejected = 0;       ///< at the level that a right image fails anywhere in 1 % of all tests
  double p_value = 1;     ///< the least one, corrected for so many tiles (Sidak)
  double resolution = 0;  ///< median over tiles of the relative standard error of the mean
};

/// Of at least two runs. Images are stored with limited precision, so that each error is taken to
/// be 1e-4 of the reference at least.
TileTest test_tiles(const std::vector<Moments>& tiles, const std::vector<double>& reference);

/// Split R-hat (Gelman et al., Bayesian Data Analysis, 3rd ed., 11.4), with runs as chains and
/// means over equal parts of a run as draws. Each run is halved; of m halves with n draws each, W
/// is the mean of the variances within, B / n the variance of the means between, and
/// R^2 = (n - 1) / n + (B / n) / W. It is about 1 where runs agree with each other and with
/// themselves.
struct Agreement {
  double rhat = 1;   ///< of W and B summed over tiles, each over m^2 + 0.01, m the tile's mean
  double worst = 1;  ///< largest of all tiles; with few draws well above 1 by chance
};

/// batches[run][part][tile], an even number of parts, at least four; at least two runs.
Agreement agreement(const std::vector<std::vector<std::vector<double>>>& batches);

/// Independent samples with a relative variance of one in each tile that would be as good as a run:
/// 1 / mean over tiles of (V / (m^2 + 0.01)), V the variance of a tile's luminance between runs and
/// m what is expected of it. Infinite if all runs are equal.
double effective_samples(const std::vector<Moments>& tiles, const std::vector<double>& expected);

/// The middle one, or the mean of both that are; of at least one number.
double median(std::vector<double> values);

}  // namespace driftlight
