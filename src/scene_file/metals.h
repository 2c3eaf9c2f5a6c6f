// SPDX-License-Identifier: Apache-2.0
/// Measured optical constants of metals, and of what else Mitsuba counts among them.
#pragma once

#include <span>
#include <string_view>
#include <utility>

namespace driftlight {

struct MetalSample {
  double wavelength;  ///< nm
  double eta;
  double k;
};

struct Metal {
  std::string_view source;  ///< the publication
  std::span<const MetalSample> samples;
};

/// By the name that Mitsuba gives them; tabulated over the whole visible range.
std::span<const std::pair<std::string_view, Metal>> metals();

}  // namespace driftlight
