// SPDX-License-Identifier: Apache-2.0
/// Tone mapping: from radiance to the 8-bit values that a display shows.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "driftlight/image.h"

namespace driftlight {

/// By default radiance 1 is white, in sRGB.
struct ToneMapping {
  enum class Operator : unsigned char {
    Exposure,  ///< 2^exposure times the radiance
    /// L (1 + L / w^2) / (1 + L) of the luminance L, in units in which its geometric mean over the
    /// image is `key` (Reinhard et al., Photographic tone reproduction for digital images, SIGGRAPH
    /// 2002, eq. 1 and 4). What becomes white is w, the largest L times (1 - burn)^2.
    Reinhard
  };

  Operator op = Operator::Exposure;
  double exposure = 0;
  double key = 0.18;
  double burn = 0;              ///< in [0, 1]
  std::optional<double> gamma;  ///< values are the power 1 / gamma; none: the curve of sRGB
};

/// Three values a pixel, as in the image. What is not a number becomes 0.
std::vector<std::uint8_t> tone_map(const Image& image, const ToneMapping& how);

}  // namespace driftlight
