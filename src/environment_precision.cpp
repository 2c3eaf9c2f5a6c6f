// SPDX-License-Identifier: Apache-2.0
#include "environment_precision.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

/// Luminances, in all channels.
Bitmap luminances(const Bitmap& map) {
  Bitmap result{map.width, map.height, {}};
  result.texels.reserve(map.texels.size());
  for (const Eigen::Array3f& c : map.texels)
    result.texels.emplace_back(
        Eigen::Array3f::Constant(static_cast<float>(luminance(Rgbd(c.cast<double>())))));
  return result;
}

/// Means of two by two texels; of an odd last row or column, of what there is.
Bitmap halved(const Bitmap& map) {
  Bitmap result{(map.width + 1) / 2, (map.height + 1) / 2, {}};
  for (int y = 0; y < result.height; ++y) {
    for (int x = 0; x < result.width; ++x) {
      const int right = std::min(2 * x + 1, map.width - 1);
      const int below = std::min(2 * y + 1, map.height - 1);
      result.texels.emplace_back(0.25F * (map.at(2 * x, 2 * y) + map.at(right, 2 * y) +
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
  std::vector<Bitmap> pyramid{luminances(map)};
  while (0.5 * texel * std::pow(2.0, static_cast<double>(pyramid.size() - 1)) < 1.0 &&
         pyramid.back().height > 1)
    pyramid.push_back(halved(pyramid.back()));
  Bitmap result{map.width, map.height, {}};
  result.texels.reserve(map.texels.size());
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const auto here = static_cast<double>(pyramid[0].at(x, y)[0]);
      double width = 1.0;
      double before = 0.0;
      for (std::size_t j = 1; j < pyramid.size(); ++j) {
        const double share = std::pow(0.5, static_cast<double>(j));
        const double blurred =
            lookup(pyramid[j], share * (x + 0.5), share * (y + 0.5), Wrap::Repeat, Wrap::Clamp)[0];
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
