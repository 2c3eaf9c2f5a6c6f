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
bool is_end_of_line(char c) { return c == '\n' || c == '\r' || c == '\0'; }

/// Goes through the text once, from character to character. Behind the last one is a zero.
class ObjText {
 public:
  explicit ObjText(const std::string& text) : at_(text.c_str()), end_(text.c_str() + text.size()) {}

  ObjPiece parse() {
    while (at_ != end_ && !piece_.problem) {
      ++piece_.line_count;
      parse_line();
      go_to_next_line();
    }
    return std::move(piece_);
  }

 private:
  void parse_line() {
    skip_blanks();
    if (is_end_of_line(*at_) || *at_ == '#') return check_end();
    const std::string_view statement = word();
    at_ += statement.size();
    if (statement == "f")
      parse_face();
    else if (statement == "v")
      parse_vector(piece_.positions, statement);
    else if (statement == "vn")
      parse_vector(piece_.normals, statement);
    else if (statement == "vt")
      parse_uv();
    else
      parse_other(statement);
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
    return c != '.' && (c < '0' || c > '9');
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
    const std::uint32_t count = static_cast<std::uint32_t>(piece_.corners.size()) - first;
    if (count < 3)
      fail("a face has fewer than three corners");
    else
      add(ObjPiece::Kind::Polygon, first, count);
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
  bool parse_index(int& index) {
    const auto [stop, error] = std::from_chars(*at_ == '+' ? at_ + 1 : at_, end_, index);
    at_ = stop;
    return error == std::errc();
  }

  void parse_other(std::string_view statement) {
    if (statement == "g")
      add_name(ObjPiece::Kind::Group);
    else if (statement == "usemtl")
      add_name(ObjPiece::Kind::Material);
    else if (statement == "mtllib")
      add_name(ObjPiece::Kind::Library);
    else if (std::find(kOtherStatements.begin(), kOtherStatements.end(), statement) ==
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
    add(kind, static_cast<std::uint32_t>(piece_.names.size()), 0);
    piece_.names.emplace_back(at_, last);
  }
  void add(ObjPiece::Kind kind, std::uint32_t first, std::uint32_t count) {
    const auto size = [](const auto& values) { return static_cast<std::uint32_t>(values.size()); };
    piece_.statements.push_back({kind,
                                 piece_.line_count,
                                 {size(piece_.positions), size(piece_.normals), size(piece_.uvs)},
                                 first,
                                 count});
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
  ObjPiece piece_;
};

}  // namespace

ObjPiece parse_obj(const std::string& lines) { return ObjText(lines).parse(); }

}  // namespace driftlight
