// SPDX-License-Identifier: Apache-2.0
/// What the lines of Wavefront OBJ files must look like: the parser takes what it does not
/// understand for zeros.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace driftlight {

struct ObjProblem {
  int line = 0;  ///< from 1
  std::string message;
};

/// The first line that is no statement, or whose numbers cannot be read. Statements that do not
/// matter to meshes may say what they like.
std::optional<ObjProblem> find_unreadable_line(const std::string& text);

/// The same of a whole file, where it may also be a face that refers to what is not there, or a
/// number that does not fit. For messages: it takes longer than reading the file.
std::optional<ObjProblem> find_obj_problem(std::string_view text);

}  // namespace driftlight
