// SPDX-License-Identifier: Apache-2.0
#include "excerpt.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace driftlight {
namespace {

/// Characters of a long line that are shown, and of these so many before the column.
constexpr std::size_t kShown = 100;
constexpr std::size_t kBefore = 40;

bool continues_character(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

/// The line without its end; nothing if the text has fewer lines.
std::string_view line_of(std::string_view text, int line) {
  for (int i = 1; i < line; ++i) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  text = text.substr(0, text.find('\n'));
  return text.ends_with('\r') ? text.substr(0, text.size() - 1) : text;
}

/// Its characters. A terminal would obey others than printable ones.
std::vector<std::string> characters(std::string_view line) {
  std::vector<std::string> result;
  for (const char c : line) {
    const bool printable = static_cast<unsigned char>(c) >= 0x20U && c != 0x7F;
    if (continues_character(c) && !result.empty())
      result.back() += c;
    else
      result.emplace_back(1, printable || c == '\t' ? c : ' ');
  }
  return result;
}

}  // namespace

SourceLocation location_in(std::string_view text, std::size_t offset) {
  SourceLocation result{"", 1, 1};
  for (const char c : text.substr(0, offset)) {
    if (c == '\n') {
      ++result.line;
      result.column = 1;
    } else if (!continues_character(c)) {
      ++result.column;
    }
  }
  return result;
}

std::string excerpt(std::string_view text, const SourceLocation& place) {
  if (place.line < 1) return {};
  const std::vector<std::string> line = characters(line_of(text, place.line));
  if (line.empty()) return {};
  const auto column = static_cast<std::size_t>(std::max(place.column, 1));
  const bool is_long = line.size() > kShown;
  const std::size_t first = is_long && column > kBefore ? column - kBefore : 0;
  const std::size_t last = std::min(line.size(), first + kShown);
  std::string shown = first > 0 ? "..." : "";
  std::string blanks(shown.size(), ' ');
  for (std::size_t i = first; i < last; ++i) {
    shown += line[i];
    // Tabs are as wide above the mark as before it.
    if (i + 1 < column) blanks += line[i] == "\t" ? "\t" : " ";
  }
  if (last < line.size()) shown += "...";
  std::string result = fmt::format("\n{:>5} | {}", place.line, shown);
  if (place.column > 0) result += fmt::format("\n{:>5} | {}^", "", blanks);
  return result;
}

std::string problem_in_line(const std::filesystem::path& file, std::string_view text, int line,
                            const std::string& message) {
  return fmt::format("{}:{}: {}{}", file.string(), line, message, excerpt(text, {"", line, 0}));
}

}  // namespace driftlight
