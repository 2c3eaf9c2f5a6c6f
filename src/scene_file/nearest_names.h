// SPDX-License-Identifier: Apache-2.0
/// What a user may have meant by a name that is not known.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace driftlight {

/// The least number of letters to insert, delete, replace or swap with their neighbours that makes
/// one name the other (optimal string alignment). Capitals and underscores do not count: names are
/// in either spelling.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// True if one name is so near to the other that it may be a slip of it.
bool is_slip(std::string_view name, std::string_view other);

/// The valid names by their distance to `name`, the nearest first; those of equal distance in their
/// order.
std::vector<std::string> by_distance(std::string_view name, std::vector<std::string> valid);

/// For the end of a message about a name that is not valid: "did you mean 'reflectance'?" if some
/// are so near that it may be a slip, else all of a short list, or the nearest of a long one.
std::string hint(std::string_view name, const std::vector<std::string>& valid);

}  // namespace driftlight
