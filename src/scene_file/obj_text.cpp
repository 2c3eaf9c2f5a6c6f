// SPDX-License-Identifier: Apache-2.0
#include "obj_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>
#include <system_error>

#include "nearest_names.h"

namespace driftlight {
namespace {

/// Statements that neither Mitsuba nor we look at: free-form curves and surfaces, points, lines,
/// smoothing groups, how to display, and what older versions had.
constexpr std::array<std::string_view, 41> kOtherStatements{
    "s",         "o",        "l",    "p",      "mg",    "vp",    "vw",   "vc",     "t",
    "deg",       "bmat",     "step", "cstype", "curv",  "curv2", "surf", "parm",   "trim",
    "hole",      "scrv",     "sp",   "end",    "con",   "bevel", "lod",  "maplib", "usemap",
    "c_interp",  "d_interp", "call", "csh",    "ctech", "stech", "bsp",  "bzp",    "shadow_obj",
    "trace_obj", "cdc",      "cdp",  "res",    "fo"};

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_end_of_line(char c) { return c == '\n' || c == '\r' || c == '\0'; }

/// Goes through the text once, from character to character. Behind the last one is a zero.
class ObjText {
 public:
  ObjText(const std::string& text, ObjPiece& piece)
      : at_(text.c_str()), end_(text.c_str() + text.size()), piece_(piece) {
    piece_.clear();
  }

  void parse() {
    while (at_ != end_ && !piece_.problem) {
      ++piece_.line_count;
      parse_line();
      go_to_next_line();
    }
  }

 private:
  void parse_line() {
    skip_blanks();
    if (is_end_of_line(*at_) || *at_ == '#') return check_end();
    if (take("f"))
      parse_face();
    else if (take("v"))
      parse_vector(piece_.positions, "v");
    else if (take("vn"))
      parse_vector(piece_.normals, "vn");
    else if (take("vt"))
      parse_uv();
    else
      parse_other();
  }

  /// Goes on behind the word, if it is the next one.
  template <std::size_t N>
  bool take(const char (&word)[N]) {
    constexpr std::size_t kLength = N - 1;
    for (std::size_t i = 0; i < kLength; ++i)
      if (at_[i] != word[i]) return false;
    if (!is_end_of_word(at_[kLength])) return false;
    at_ += kLength;
    return true;
  }

  void parse_vector(std::vector<Eigen::Vector3f>& into, std::string_view statement) {
    std::array<float, 3> numbers{};
    if (parse_numbers(numbers, statement, 3)) into.emplace_back(numbers.data());
  }
  void parse_uv() {
    std::array<float, 2> numbers{};
    if (parse_numbers(numbers, "vt", 1)) piece_.uvs.emplace_back(numbers.data());
  }

  /// As many as there are into as many as there is room for. False if there is a problem.
  template <std::size_t N>
  bool parse_numbers(std::array<float, N>& numbers, std::string_view statement, std::size_t least) {
    std::size_t count = 0;
    for (skip_blanks(); !is_end_of_line(*at_) && *at_ != '#'; skip_blanks(), ++count) {
      float x = 0;
      const char* const first = *at_ == '+' ? at_ + 1 : at_;
      const auto [stop, error] = std::from_chars(first, end_, x);
      if (error == std::errc::result_out_of_range && !is_tiny(std::string(first, stop)))
        return fail(in_quotes(word()) + " is not finite");
      if (error == std::errc::invalid_argument || !is_end_of_word(*stop) || is_a_word(first))
        return fail(in_quotes(word()) + " is not a number");
      if (count < N) numbers[count] = x;
      at_ = stop;
    }
    if (count < least)
      return fail(fmt::format("'{}' needs {} numbers, not {}", statement, least, count));
    return true;
  }

  /// Such as nan, which from_chars takes for a number.
  static bool is_a_word(const char* first) {
    const char c = *first == '-' ? first[1] : *first;
    return c != '.' && !is_digit(c);
  }
  /// A number that is out of range since it is nearly zero, and then is zero.
  static bool is_tiny(const std::string& number) {
    const std::size_t exponent = number.find_first_of("eE");
    return exponent != std::string::npos && number.compare(exponent + 1, 1, "-") == 0;
  }

  void parse_face() {
    const auto first = static_cast<std::uint32_t>(piece_.corners.size());
    for (skip_blanks(); !is_end_of_line(*at_) && *at_ != '#'; skip_blanks()) {
      const char* const start = at_;
      ObjPiece::Corner corner;
      if (!parse_corner(corner)) {
        at_ = start;
        fail(in_quotes(word()) + " is not a corner of a face, such as 1, 1/2, 1//3 or 1/2/3");
        return;
      }
      piece_.corners.push_back(corner);
    }
    const std::uint32_t corners = static_cast<std::uint32_t>(piece_.corners.size()) - first;
    if (corners < 3)
      fail("a face has fewer than three corners");
    else if (follows_polygons(corners))
      ++piece_.statements.back().count;
    else
      add(ObjPiece::Kind::Polygons, first, corners);
  }

  /// Whether the line before was one of the last statement, of as many corners each.
  bool follows_polygons(std::uint32_t corners) const {
    if (piece_.statements.empty()) return false;
    const ObjPiece::Statement& last = piece_.statements.back();
    return last.kind == ObjPiece::Kind::Polygons && last.corners == corners &&
           last.line + static_cast<int>(last.count) == piece_.line_count;
  }

  bool parse_corner(ObjPiece::Corner& corner) {
    if (!parse_index(corner.position)) return false;
    if (*at_ == '/') {
      ++at_;
      if (*at_ != '/' && !is_end_of_word(*at_) && !parse_index(corner.uv)) return false;
      if (*at_ == '/') {
        ++at_;
        if (!is_end_of_word(*at_) && !parse_index(corner.normal)) return false;
      }
    }
    return is_end_of_word(*at_);
  }
  /// Most of a large file is indices: short ones without from_chars, which takes twice the time.
  bool parse_index(int& index) {
    constexpr std::ptrdiff_t kShort = 9;
    const char* stop = at_;
    int value = 0;
    while (is_digit(*stop) && stop - at_ < kShort) value = 10 * value + (*stop++ - '0');
    if (stop != at_ && !is_digit(*stop)) {
      index = value;
      at_ = stop;
      return true;
    }
    const auto result = std::from_chars(*at_ == '+' ? at_ + 1 : at_, end_, index);
    at_ = result.ptr;
    return result.ec == std::errc();
  }

  void parse_other() {
    if (take("g")) return add_name(ObjPiece::Kind::Group);
    if (take("usemtl")) return add_name(ObjPiece::Kind::Material);
    if (take("mtllib")) return add_name(ObjPiece::Kind::Library);
    const std::string_view statement = word();
    if (std::find(kOtherStatements.begin(), kOtherStatements.end(), statement) ==
        kOtherStatements.end())
      fail(unknown(statement));
  }
  static std::string unknown(std::string_view statement) {
    std::vector<std::string> names{"v", "vn", "vt", "f", "g", "usemtl", "mtllib"};
    names.insert(names.end(), kOtherStatements.begin(), kOtherStatements.end());
    return fmt::format("unknown statement {}; {}", in_quotes(statement), hint(statement, names));
  }

  /// The rest of the line is a name, which may have blanks in it.
  void add_name(ObjPiece::Kind kind) {
    skip_blanks();
    const char* last = at_;
    while (!is_end_of_line(*last)) ++last;
    while (last > at_ && is_blank(last[-1])) --last;
    add(kind, static_cast<std::uint32_t>(piece_.names.size()));
    piece_.names.emplace_back(at_, last);
  }
  void add(ObjPiece::Kind kind, std::uint32_t first, std::uint32_t corners = 0) {
    const auto size = [](const auto& values) { return static_cast<std::uint32_t>(values.size()); };
    piece_.statements.push_back({kind,
                                 piece_.line_count,
                                 {size(piece_.positions), size(piece_.normals), size(piece_.uvs)},
                                 first,
                                 corners});
  }

  bool fail(const std::string& message) {
    piece_.problem = {piece_.line_count, message};
    return false;
  }
  /// A zero within the text is no end of a line.
  void check_end() {
    while (!is_end_of_line(*at_)) ++at_;
    if (*at_ == '\0' && at_ != end_) fail("there is a character of code 0");
  }
  void go_to_next_line() {
    if (piece_.problem) return;
    check_end();
    if (*at_ == '\r' && at_[1] == '\n') ++at_;
    if (at_ != end_) ++at_;
  }

  static std::string in_quotes(std::string_view word) {
    constexpr std::size_t kShown = 40;
    return fmt::format("'{}'", word.substr(0, kShown));
  }
  static bool is_end_of_word(char c) { return is_blank(c) || is_end_of_line(c); }
  std::string_view word() const {
    const char* last = at_;
    while (!is_end_of_word(*last)) ++last;
    return {at_, static_cast<std::size_t>(last - at_)};
  }
  void skip_blanks() {
    while (is_blank(*at_)) ++at_;
  }

  const char* at_;
  const char* end_;
  ObjPiece& piece_;
};

}  // namespace

void ObjPiece::clear() {
  positions.clear();
  normals.clear();
  uvs.clear();
  corners.clear();
  names.clear();
  statements.clear();
  line_count = 0;
  problem.reset();
}

void parse_obj(const std::string& lines, ObjPiece& piece) { ObjText(lines, piece).parse(); }

}  // namespace driftlight
