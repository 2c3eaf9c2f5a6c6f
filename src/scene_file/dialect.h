// SPDX-License-Identifier: Apache-2.0
/// The two dialects of scene files.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace driftlight {

/// They differ in how names are spelt, in a few defaults, and in that only the newer one lets a
/// <ref> name what stands further down.
enum class Dialect {
  Mitsuba06,  ///< "toWorld"; versions 0.5 and 0.6
  Mitsuba3    ///< "to_world"; versions 2 and 3
};

/// By the attribute `version` of <scene>; nothing if we read neither.
std::optional<Dialect> dialect_of(std::string_view version);

/// True for versions whose Mitsuba interpolated lists of wavelengths from the wrong ends, see
/// interpolated_backwards().
bool has_backward_spectra(std::string_view version);

/// A name such as "intIOR" in the spelling of the newer dialect, "int_ior". A name without capitals
/// stays as it is.
std::string snake_case(std::string_view name);

/// A name in camel case as the dialect spells it.
std::string spelling(std::string_view name, Dialect dialect);

}  // namespace driftlight
