// SPDX-License-Identifier: Apache-2.0
/// Pictures of where an image is wrong.
#pragma once

#include <vector>

#include "driftlight/image.h"

namespace driftlight::cli {

/// The ends of the scale of colours, which is logarithmic.
inline constexpr double kLeastError = 0.01;
inline constexpr double kLargestError = 1;

/// Root of the relative squared error of each pixel: of the mean over channels of
/// (I - R)^2 / (R^2 + 0.01).
std::vector<double> pixel_errors(const Image& image, const Image& reference);

/// The same by the spread of two runs: of (a - b)^2 / 2 / (M^2 + 0.01), M what is expected.
std::vector<double> pixel_spread(const Image& a, const Image& b, const Image& expected);

/// Errors as colours from black by red to light yellow; rows from the top.
Image error_map(const std::vector<double>& errors, int width);

/// The scale of colours from the least error to the largest, left to right.
Image error_scale(int width);

}  // namespace driftlight::cli
