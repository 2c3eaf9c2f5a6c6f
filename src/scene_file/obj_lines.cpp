// SPDX-License-Identifier: Apache-2.0
#include "obj_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>
#include <vector>

#include "nearest_names.h"
#include "text.h"

namespace driftlight {
namespace {

/// Statements that neither Mitsuba nor we look at: free-form curves and surfaces, points, lines,
/// smoothing groups, how to display, and what older versions had.
constexpr std::array<std::string_view, 44> kOtherStatements{
    "g",    "s",      "o",          "usemtl",    "mtllib",   "l",    "p",      "mg",    "vp",
    "vw",   "vc",     "t",          "deg",       "bmat",     "step", "cstype", "curv",  "curv2",
    "surf", "parm",   "trim",       "hole",      "scrv",     "sp",   "end",    "con",   "bevel",
    "lod",  "maplib", "usemap",     "c_interp",  "d_interp", "call", "csh",    "ctech", "stech",
    "bsp",  "bzp",    "shadow_obj", "trace_obj", "cdc",      "cdp",  "res",    "fo"};

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The characters of one line, read from left to right. The character after the last is a zero.
class ObjLine {
 public:
  explicit ObjLine(std::string_view text) : text_(text) {}

  std::string_view rest() const { return text_.substr(position_); }
  void skip_blanks() {
    while (is_blank(front())) ++position_;
  }
  std::string_view word() const {
    std::size_t end = position_;
    while (end < text_.size() && !is_blank(text_[end])) ++end;
    return text_.substr(position_, end - position_);
  }
  void skip(std::size_t characters) { position_ += characters; }
  /// No more words, but perhaps a comment.
  bool is_done() const { return position_ == text_.size() || front() == '#'; }

  /// Goes past a number such as -1.5e3; false if there is none that a blank or the end follows.
  bool skip_number() {
    skip_sign();
    std::size_t digits = skip_digits();
    if (front() == '.') {
      ++position_;
      digits += skip_digits();
    }
    if (digits == 0) return false;
    if (front() == 'e' || front() == 'E') {
      ++position_;
      skip_sign();
      if (skip_digits() == 0) return false;
    }
    return is_at_end_of_word();
  }

  /// Likewise past the corner of a face: 1, 1/2, 1//3 or 1/2/3.
  bool skip_corner() {
    skip_sign();
    if (skip_digits() == 0) return false;
    for (int i = 0; i < 2 && front() == '/'; ++i) {
      ++position_;
      skip_sign();
      skip_digits();
    }
    return is_at_end_of_word();
  }

 private:
  char front() const { return position_ < text_.size() ? text_[position_] : '\0'; }
  bool is_at_end_of_word() const { return position_ == text_.size() || is_blank(front()); }
  void skip_sign() {
    if (front() == '-' || front() == '+') ++position_;
  }
  std::size_t skip_digits() {
    const std::size_t first = position_;
    while (is_digit(front())) ++position_;
    return position_ - first;
  }

  std::string_view text_;
  std::size_t position_ = 0;
};

std::string in_quotes(std::string_view word) {
  constexpr std::size_t kShown = 40;
  return fmt::format("'{}'", word.substr(0, kShown));
}

/// What is wrong with the numbers of a statement; empty if nothing.
std::string problem_of_numbers(ObjLine& line, std::string_view statement, int least) {
  int count = 0;
  for (line.skip_blanks(); !line.is_done(); line.skip_blanks(), ++count) {
    ObjLine number = line;
    if (!number.skip_number()) return in_quotes(line.word()) + " is not a number";
    line = number;
  }
  if (count >= least) return {};
  return fmt::format("'{}' needs {} numbers, not {}", statement, least, count);
}

std::string problem_of_face(ObjLine& line) {
  int count = 0;
  for (line.skip_blanks(); !line.rest().empty(); line.skip_blanks(), ++count) {
    ObjLine corner = line;
    if (!corner.skip_corner())
      return in_quotes(line.word()) + " is not a corner of a face, such as 1, 1/2, 1//3 or 1/2/3";
    line = corner;
  }
  return count < 3 ? "a face has fewer than three corners" : std::string();
}

bool is_other_statement(std::string_view word) {
  return std::find(kOtherStatements.begin(), kOtherStatements.end(), word) !=
         kOtherStatements.end();
}

std::string problem_of_statement(std::string_view statement) {
  if (is_other_statement(statement)) return {};
  std::vector<std::string> names{"v", "vn", "vt", "f"};
  names.insert(names.end(), kOtherStatements.begin(), kOtherStatements.end());
  return fmt::format("unknown statement {}; {}", in_quotes(statement), hint(statement, names));
}

/// What is wrong with a line by itself; empty if nothing.
std::string problem_of_line(std::string_view text) {
  ObjLine line(text);
  line.skip_blanks();
  if (line.is_done()) return {};
  const std::string_view statement = line.word();
  line.skip(statement.size());
  if (statement == "f") return problem_of_face(line);
  if (statement == "v" || statement == "vn") return problem_of_numbers(line, statement, 3);
  if (statement == "vt") return problem_of_numbers(line, statement, 1);
  return problem_of_statement(statement);
}

/// The first problem that `problem_of` finds with a line, which may end as on any system.
template <class ProblemOf>
std::optional<ObjProblem> find_problem(std::string_view text, ProblemOf problem_of) {
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    const std::size_t carriage_return = line.find('\r');
    line = line.substr(0, carriage_return);
    if (std::string problem = problem_of(line); !problem.empty())
      return ObjProblem{number, std::move(problem)};
    std::size_t length = std::min(end, text.size() - 1) + 1;
    // One in the middle of a line ends it.
    if (carriage_return != std::string_view::npos && carriage_return + 1 != end)
      length = carriage_return + 1;
    text.remove_prefix(length);
  }
  return std::nullopt;
}

/// Sees quickly that all is well with the lines that make up a mesh, without looking for the ends
/// of lines first: no digit, point or sign is one. After the text there is a zero.
class PlainLines {
 public:
  explicit PlainLines(const std::string& text)
      : at_(text.c_str()), end_(text.c_str() + text.size()) {}

  /// False if some line is wrong, or needs a closer look.
  bool are_plain() {
    while (true) {
      skip_blanks();
      if (*at_ == 'f' && is_blank(at_[1])) {
        ++at_;
        if (!has_words<&PlainLines::skip_corner>(3)) return false;
      } else if (*at_ == 'v' && is_blank(at_[1])) {
        ++at_;
        if (!has_words<&PlainLines::skip_number>(3)) return false;
      } else if (*at_ == 'v' && (at_[1] == 'n' || at_[1] == 't') && is_blank(at_[2])) {
        const int least = at_[1] == 'n' ? 3 : 1;
        at_ += 2;
        if (!has_words<&PlainLines::skip_number>(least)) return false;
      } else if (!is_at_end_of_line()) {
        if (!skip_other_statement()) return false;
      }
      if (*at_ == '\r' && at_[1] == '\n') ++at_;
      if (at_ == end_) return true;
      if (*at_ != '\n') return false;
      ++at_;
    }
  }

 private:
  template <bool (PlainLines::*SkipWord)()>
  bool has_words(int least) {
    for (int count = 0;; ++count) {
      skip_blanks();
      if (is_at_end_of_line()) return count >= least;
      if (!(this->*SkipWord)()) return false;
    }
  }

  void skip_blanks() {
    while (is_blank(*at_)) ++at_;
  }
  void skip_sign() {
    if (*at_ == '-' || *at_ == '+') ++at_;
  }
  bool skip_digits() {
    if (!is_digit(*at_)) return false;
    do ++at_;
    while (is_digit(*at_));
    return true;
  }
  bool is_at_end_of_line() const { return *at_ == '\n' || *at_ == '\r' || *at_ == '\0'; }
  bool is_at_end_of_word() const { return is_blank(*at_) || is_at_end_of_line(); }
  /// To the end of the line.
  bool skip_other_statement() {
    const char* const first = at_;
    while (!is_at_end_of_word()) ++at_;
    const std::string_view statement(first, static_cast<std::size_t>(at_ - first));
    const bool is_fine = *first == '#' || is_other_statement(statement);
    while (!is_at_end_of_line()) ++at_;
    return is_fine;
  }
  bool skip_number() {
    skip_sign();
    if (!skip_digits()) return false;
    if (*at_ == '.') {
      ++at_;
      skip_digits();
    }
    if (*at_ == 'e' || *at_ == 'E') {
      ++at_;
      skip_sign();
      if (!skip_digits()) return false;
    }
    return is_at_end_of_word();
  }
  bool skip_corner() {
    skip_sign();
    if (!skip_digits()) return false;
    for (int i = 0; i < 2 && *at_ == '/'; ++i) {
      ++at_;
      skip_sign();
      skip_digits();
    }
    return is_at_end_of_word();
  }

  const char* at_;
  const char* end_;
};

/// Knows what the lines before have given.
class ObjChecker {
 public:
  std::string problem_of(std::string_view text) {
    if (std::string problem = problem_of_line(text); !problem.empty()) return problem;
    const std::vector<std::string> words = split(text, " \t");
    if (words.empty()) return {};
    if (words[0] == "v") ++positions_;
    if (words[0] == "vn") ++normals_;
    if (words[0] == "vt") ++uvs_;
    return words[0] == "f" ? problem_of_corners(words) : problem_of_values(words);
  }

 private:
  static std::string problem_of_values(const std::vector<std::string>& words) {
    if (words[0] != "v" && words[0] != "vn" && words[0] != "vt") return {};
    for (std::size_t i = 1; i < words.size() && words[i][0] != '#'; ++i)
      if (!std::isfinite(std::strtof(words[i].c_str(), nullptr)))
        return in_quotes(words[i]) + " is not finite";
    return {};
  }

  std::string problem_of_corners(const std::vector<std::string>& words) const {
    for (std::size_t i = 1; i < words.size(); ++i) {
      const std::string& word = words[i];
      const std::size_t slash = std::min(word.find('/'), word.size());
      const std::size_t second = std::min(word.find('/', slash + 1), word.size());
      const auto part = [&](std::size_t first, std::size_t end) {
        return first < end ? word.substr(first, end - first) : std::string();
      };
      std::string problem = problem_of_index(part(0, slash), positions_, "vertex");
      if (problem.empty())
        problem = problem_of_index(part(slash + 1, second), uvs_, "texture coordinate");
      if (problem.empty())
        problem = problem_of_index(part(second + 1, word.size()), normals_, "normal");
      if (!problem.empty()) return problem;
    }
    return {};
  }

  /// From 1, or from the end if negative; there may be none but of positions, which have digits.
  static std::string problem_of_index(const std::string& text, long long size, const char* what) {
    if (text.empty()) return {};
    const long long index = std::strtoll(text.c_str(), nullptr, 10);
    const bool may_lack = std::string_view(what) != "vertex";
    if (index == 0 && may_lack) return {};
    if (index != 0 && index >= -size && index <= size) return {};
    return fmt::format("a face refers to {} {}, but there are only {}", what, text, size);
  }

  long long positions_ = 0;
  long long normals_ = 0;
  long long uvs_ = 0;
};

}  // namespace

std::optional<ObjProblem> find_unreadable_line(const std::string& text) {
  if (PlainLines(text).are_plain()) return std::nullopt;
  return find_problem(text, &problem_of_line);
}

std::optional<ObjProblem> find_obj_problem(std::string_view text) {
  ObjChecker checker;
  return find_problem(text, [&](std::string_view line) { return checker.problem_of(line); });
}

}  // namespace driftlight
