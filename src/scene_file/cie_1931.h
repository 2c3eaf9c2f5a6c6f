// SPDX-License-Identifier: Apache-2.0
/// The standard observer.
#pragma once

#include <array>

namespace driftlight {

inline constexpr int kCieFirst = 360;  ///< wavelength of the first sample, nm
inline constexpr int kCieSamples = 471;

/// CIE 1931 2-degree colour matching functions: x, y, z at every nanometre from kCieFirst.
extern const std::array<double, 3 * kCieSamples> kCie1931;

}  // namespace driftlight
