// SPDX-License-Identifier: Apache-2.0
/// Lines of text files, as messages show them.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "driftlight/error.h"

namespace driftlight {

/// Line and column, both from 1, of a byte of a text; columns count characters. The file's name is
/// left empty.
SourceLocation location_in(std::string_view text, std::size_t offset);

/// The line of the text at a place and a mark under its column, each after a line end:
///       4 |   <float name="shine"/>
///         |   ^
/// Without a column there is no mark. Of a long line the part around the column. Empty if there is
/// no such line.
std::string excerpt(std::string_view text, const SourceLocation& place);

/// A problem in a line of a text file other than the scene's, for an InputError: "file:line: ..",
/// and the line.
std::string problem_in_line(const std::filesystem::path& file, std::string_view text, int line,
                            const std::string& message);

/// An InputError in a line of a text that does not know of which file.
class LineError : public InputError {
 public:
  LineError(int line, const std::string& message) : InputError(message), line_(line) {}
  int line() const { return line_; }

 private:
  int line_;
};

}  // namespace driftlight
