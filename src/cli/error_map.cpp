// SPDX-License-Identifier: Apache-2.0
#include "cli/error_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace driftlight::cli {

namespace {

using Rgb = std::array<float, 3>;

/// Of even steps in lightness: "inferno" of Matplotlib (Smith and van der Walt), linear sRGB.
constexpr std::array<Rgb, 10> kColors{{{0.0000F, 0.0000F, 0.0012F},
                                       {0.0110F, 0.0037F, 0.0529F},
                                       {0.0685F, 0.0037F, 0.1470F},
                                       {0.1878F, 0.0116F, 0.1529F},
                                       {0.3763F, 0.0252F, 0.1170F},
                                       {0.6240F, 0.0578F, 0.0612F},
                                       {0.8469F, 0.1413F, 0.0185F},
                                       {0.9647F, 0.3278F, 0.0018F},
                                       {0.9301F, 0.6376F, 0.0467F},
                                       {0.9734F, 1.0000F, 0.3712F}}};

/// `x` from 0 to 1 along the colours. Not a number is at the end.
Rgb color_at(double x) {
  constexpr auto kLast = static_cast<double>(kColors.size() - 1);
  const double along = x <= 1.0 ? std::max(x, 0.0) * kLast : kLast;
  const auto below = static_cast<std::size_t>(std::min(along, kLast - 1.0));
  const auto t = static_cast<float>(along - static_cast<double>(below));
  Rgb color{};
  for (std::size_t c = 0; c < 3; ++c)
    color.at(c) = (1.0F - t) * kColors.at(below).at(c) + t * kColors.at(below + 1).at(c);
  return color;
}

Image picture(const std::vector<double>& positions, int width) {
  Image image(width, static_cast<int>(positions.size()) / width);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Rgb color = color_at(positions[i]);
    std::copy(color.begin(), color.end(), &image.rgb[3 * i]);
  }
  return image;
}

/// Of (I - J)^2 / (M^2 + 0.01) times the share.
std::vector<double> root_errors(const Image& i, const Image& j, const Image& m, double share) {
  std::vector<double> errors(i.rgb.size() / 3);
  for (std::size_t k = 0; k < errors.size(); ++k) {
    double sum = 0;
    for (std::size_t c = 3 * k; c < 3 * k + 3; ++c) {
      const double difference = static_cast<double>(i.rgb[c]) - static_cast<double>(j.rgb[c]);
      const auto expected = static_cast<double>(m.rgb[c]);
      sum += difference * difference / (expected * expected + 0.01);
    }
    errors[k] = std::sqrt(share * sum / 3.0);
  }
  return errors;
}

}  // namespace

std::vector<double> pixel_errors(const Image& image, const Image& reference) {
  return root_errors(image, reference, reference, 1.0);
}

std::vector<double> pixel_spread(const Image& a, const Image& b, const Image& expected) {
  return root_errors(a, b, expected, 0.5);
}

Image error_map(const std::vector<double>& errors, int width) {
  std::vector<double> positions = errors;
  for (double& x : positions) x = std::log(x / kLeastError) / std::log(kLargestError / kLeastError);
  return picture(positions, width);
}

Image error_scale(int width) {
  std::vector<double> positions(static_cast<std::size_t>(width));
  for (std::size_t i = 0; i < positions.size(); ++i)
    positions[i] = (static_cast<double>(i) + 0.5) / width;
  return picture(positions, width);
}

}  // namespace driftlight::cli
