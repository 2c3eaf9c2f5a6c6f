// SPDX-License-Identifier: Apache-2.0
/// The texts of attributes: numbers, lists and names.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace driftlight {

/// The finite number that the whole text spells, blanks around it aside; else nothing.
std::optional<double> parse_number(std::string_view text);
/// The same for integers; nothing if it does not fit.
std::optional<int> parse_integer(std::string_view text);

/// The non-empty parts between any of the separators.
std::vector<std::string> split(std::string_view text, std::string_view separators);
/// The parts of a list of numbers: Mitsuba separates by commas and blanks.
std::vector<std::string> split_list(std::string_view text);

/// ASCII letters in lower case.
std::string lower_case(std::string_view text);
/// "a, b, c"
std::string join(const std::vector<std::string>& names);

}  // namespace driftlight
