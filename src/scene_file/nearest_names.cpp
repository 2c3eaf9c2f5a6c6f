// SPDX-License-Identifier: Apache-2.0
#include "nearest_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include "text.h"

namespace driftlight {
namespace {

/// A list that one reads at a glance.
constexpr std::size_t kShortList = 12;
/// Of a longer one.
constexpr std::size_t kNearest = 5;
/// Names that are near are offered as long as they are so few.
constexpr std::size_t kOffered = 3;
/// No name is longer, and the distance takes the square of it.
constexpr std::size_t kLongestName = 64;

std::string letters(std::string_view name) {
  std::string result = lower_case(name.substr(0, kLongestName));
  std::erase(result, '_');
  return result;
}

}  // namespace

std::size_t edit_distance(std::string_view a, std::string_view b) {
  const std::string from = letters(a);
  const std::string to = letters(b);
  // Rows of the table of distances between beginnings: the one before the last, the last, this one.
  std::vector<std::size_t> older(to.size() + 1);
  std::vector<std::size_t> last(to.size() + 1);
  std::vector<std::size_t> row(to.size() + 1);
  for (std::size_t j = 0; j <= to.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= from.size(); ++i) {
    std::swap(older, last);
    std::swap(last, row);
    row[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (from[i - 1] == to[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, replaced});
      const bool swapped = i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1];
      if (swapped) row[j] = std::min(row[j], older[j - 2] + 1);
    }
  }
  return row[to.size()];
}

/// One letter in three may be wrong.
bool is_slip(std::string_view name, std::string_view other) {
  const std::size_t length = std::min(letters(name).size(), letters(other).size());
  return edit_distance(name, other) <= (length + 1) / 3;
}

std::vector<std::string> by_distance(std::string_view name, std::vector<std::string> valid) {
  std::vector<std::pair<std::size_t, std::string>> sorted;
  for (std::string& known : valid) {
    const std::size_t distance = edit_distance(name, known);
    sorted.emplace_back(distance, std::move(known));
  }
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  valid.clear();
  for (auto& [distance, known] : sorted) valid.push_back(std::move(known));
  return valid;
}

std::string hint(std::string_view name, const std::vector<std::string>& valid) {
  if (valid.empty()) return "valid are: none";
  std::vector<std::string> nearest = by_distance(name, valid);
  const auto offered = std::min(nearest.size(), kOffered);
  std::string text;
  for (std::size_t i = 0; i < offered && is_slip(name, nearest[i]); ++i)
    text += fmt::format("{}'{}'", text.empty() ? "did you mean " : " or ", nearest[i]);
  if (!text.empty()) return text + "?";
  if (valid.size() <= kShortList) return "valid are: " + join(valid);
  nearest.resize(kNearest);
  return fmt::format("the nearest of {} are: {}", valid.size(), join(nearest));
}

}  // namespace driftlight
