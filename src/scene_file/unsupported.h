// SPDX-License-Identifier: Apache-2.0
/// What Mitsuba knows and we do not, where it would change the picture.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace driftlight {

/// True if the plugin of Mitsuba has a property of this name (in snake case) that changes the
/// picture and that no reader here asks for. Such a property is refused, unlike one that Mitsuba
/// does not know either. `type` is that of the plugin, `tag` that of its element.
bool is_unsupported_property(std::string_view tag, std::string_view type, std::string_view name);

/// True if an element with this tag is geometry, light or matter wherever it stands, so that the
/// picture is another one without it.
bool is_part_of_picture(std::string_view tag);

/// Of all elements that Mitsuba knows.
std::vector<std::string> known_tags();

}  // namespace driftlight
