// SPDX-License-Identifier: Apache-2.0
#include "environment_precision.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

/// One number a texel, in the layout of bitmaps.
struct Grid {
  int width = 0;
  int height = 0;
  std::vector<float> values;

  float at(int x, int y) const {
    return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
  /// Bilinear between the centres of texels, repeated along x and clamped along y. As `lookup` of a
  /// bitmap, but of large maps there are ten million of these.
  double interpolated(double x, double y) const {
    const double left = std::floor(x - 0.5);
    const double top = std::floor(y - 0.5);
    const int x0 = (static_cast<int>(left) + width) % width;
    const int x1 = x0 + 1 < width ? x0 + 1 : 0;
    const int y0 = std::max(static_cast<int>(top), 0);
    const int y1 = std::min(static_cast<int>(top) + 1, height - 1);
    const double fx = x - (left + 0.5);
    const double fy = y - (top + 0.5);
    const auto row = [&](int at_y) {
      const auto first = static_cast<double>(at(x0, at_y));
      return first + fx * (static_cast<double>(at(x1, at_y)) - first);
    };
    const double upper = row(y0);
    return upper + fy * (row(y1) - upper);
  }
};

Grid luminances(const Bitmap& map) {
  Grid result{map.width, map.height, {}};
  result.values.reserve(map.texels.size());
  for (const Eigen::Array3f& c : map.texels)
    result.values.push_back(static_cast<float>(luminance(Rgbd(c.cast<double>()))));
  return result;
}

/// Means of two by two texels; of an odd last row or column, of what there is.
Grid halved(const Grid& map) {
  Grid result{(map.width + 1) / 2, (map.height + 1) / 2, {}};
  for (int y = 0; y < result.height; ++y) {
    for (int x = 0; x < result.width; ++x) {
      const int right = std::min(2 * x + 1, map.width - 1);
      const int below = std::min(2 * y + 1, map.height - 1);
      result.values.push_back(0.25F * (map.at(2 * x, 2 * y) + map.at(right, 2 * y) +
                                       map.at(2 * x, below) + map.at(right, below)));
    }
  }
  return result;
}

/// |log2| of the ratio of two luminances, of which either may be 0.
double octaves(double a, double b) {
  constexpr double kDark = 1e-30;
  return std::abs(std::log2((a + kDark) / (b + kDark)));
}

}  // namespace

/// Boxes of side a, interpolated bilinearly, blur by a^2 / 12 + a^2 / 6 = (a / 2)^2. Between two of
/// them the scale is interpolated in log s by the octaves.
Bitmap environment_precision(const Bitmap& map) {
  const double texel = kPi / map.height;
  std::vector<Grid> pyramid{luminances(map)};
  // Of each level its scale 2^-j.
  std::vector<double> shares{1.0};
  while (0.5 * texel * std::pow(2.0, static_cast<double>(pyramid.size() - 1)) < 1.0 &&
         pyramid.back().height > 1) {
    pyramid.push_back(halved(pyramid.back()));
    shares.push_back(0.5 * shares.back());
  }
  Bitmap result{map.width, map.height, {}};
  result.texels.reserve(map.texels.size());
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const auto here = static_cast<double>(pyramid[0].at(x, y));
      double width = 1.0;
      double before = 0.0;
      for (std::size_t j = 1; j < pyramid.size(); ++j) {
        const double blurred =
            pyramid[j].interpolated(shares[j] * (x + 0.5), shares[j] * (y + 0.5));
        const double change = octaves(blurred, here);
        if (change >= 1.0) {
          const double back = (change - 1.0) / (change - before);
          width = 0.5 * texel * std::pow(2.0, static_cast<double>(j) - back);
          break;
        }
        before = change;
      }
      width = std::clamp(width, std::min(texel, 1.0), 1.0);
      result.texels.emplace_back(
          Eigen::Array3f::Constant(static_cast<float>(1.0 / (width * width))));
    }
  }
  return result;
}

}  // namespace driftlight
