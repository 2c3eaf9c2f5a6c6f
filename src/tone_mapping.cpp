// SPDX-License-Identifier: Apache-2.0
#include "driftlight/tone_mapping.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "driftlight/scalar.h"

namespace driftlight {
namespace {

/// Linear light -> the nearest of 256 encoded values. NaN becomes 0.
std::uint8_t encode(float x, const std::optional<double>& gamma) {
  float y = 0;
  if (gamma)
    y = std::pow(std::max(x, 0.0F), static_cast<float>(1.0 / *gamma));
  else
    y = x <= 0.0031308F ? 12.92F * x : 1.055F * std::pow(x, 1.0F / 2.4F) - 0.055F;
  return y > 0.0F ? static_cast<std::uint8_t>(std::lround(std::min(y, 1.0F) * 255.0F))
                  : std::uint8_t{0};
}

/// The factor on a pixel by its luminance.
class Reinhard {
 public:
  Reinhard(const Image& image, const ToneMapping& how) {
    // As in Mitsuba: black counts as a thousandth, and there is always some white.
    double sum = 0;
    double largest = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
      const double y = luminance_of(&image.rgb[i]);
      if (!std::isfinite(y)) continue;
      largest = std::max(largest, y);
      sum += std::log(1e-3 + std::max(y, 0.0));
      ++count;
    }
    if (!(largest > 0.0)) return;
    scale_ = how.key / std::exp(sum / static_cast<double>(count));
    const double unburnt = std::max(1e-8, 1.0 - how.burn);
    const double white = largest * scale_ * unburnt * unburnt;
    inverse_white2_ = 1.0 / (white * white);
  }

  float factor(const float* rgb) const {
    const double l = scale_ * luminance_of(rgb);
    return static_cast<float>(scale_ * (1.0 + l * inverse_white2_) / (1.0 + l));
  }

 private:
  static double luminance_of(const float* rgb) {
    return luminance(Rgbd(static_cast<double>(rgb[0]), static_cast<double>(rgb[1]),
                          static_cast<double>(rgb[2])));
  }

  double scale_ = 1;
  double inverse_white2_ = 0;
};

}  // namespace

std::vector<std::uint8_t> tone_map(const Image& image, const ToneMapping& how) {
  std::optional<Reinhard> reinhard;
  if (how.op == ToneMapping::Operator::Reinhard) reinhard.emplace(image, how);
  const auto exposure = static_cast<float>(std::exp2(how.exposure));
  std::vector<std::uint8_t> result(image.rgb.size());
  for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
    const float factor = reinhard ? reinhard->factor(&image.rgb[i]) : exposure;
    for (std::size_t c = 0; c < 3; ++c)
      result[i + c] = encode(factor * image.rgb[i + c], how.gamma);
  }
  return result;
}

}  // namespace driftlight
