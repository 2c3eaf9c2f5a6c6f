// SPDX-License-Identifier: Apache-2.0
#include "ply_header.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <utility>

#include "driftlight/error.h"
#include "excerpt.h"
#include "nearest_names.h"
#include "text.h"

namespace driftlight {
namespace {

/// No header of a mesh is longer; a file that is none may be one long line.
constexpr std::size_t kMaximumHeader = 1U << 16U;

constexpr std::array<std::pair<std::string_view, PlyType>, 16> kPlyTypes{{
    {"char", PlyType::Int8},
    {"int8", PlyType::Int8},
    {"uchar", PlyType::UInt8},
    {"uint8", PlyType::UInt8},
    {"short", PlyType::Int16},
    {"int16", PlyType::Int16},
    {"ushort", PlyType::UInt16},
    {"uint16", PlyType::UInt16},
    {"int", PlyType::Int32},
    {"int32", PlyType::Int32},
    {"uint", PlyType::UInt32},
    {"uint32", PlyType::UInt32},
    {"float", PlyType::Float32},
    {"float32", PlyType::Float32},
    {"double", PlyType::Float64},
    {"float64", PlyType::Float64},
}};

constexpr std::array<std::pair<std::string_view, PlyEncoding>, 3> kPlyEncodings{{
    {"ascii", PlyEncoding::Ascii},
    {"binary_little_endian", PlyEncoding::LittleEndian},
    {"binary_big_endian", PlyEncoding::BigEndian},
}};

/// Reads a header line by line.
class PlyHeaderReader {
 public:
  explicit PlyHeaderReader(std::string_view bytes) : bytes_(bytes.substr(0, kMaximumHeader)) {}

  PlyHeader read() {
    if (next_line() != std::vector<std::string>{"ply"}) fail("is not 'ply'");
    for (std::vector<std::string> words = next_line(); !is(words, "end_header");
         words = next_line())
      read(words);
    if (!has_format_) throw InputError("its header gives no format");
    header_.size = position_;
    return std::move(header_);
  }

 private:
  static bool is(const std::vector<std::string>& words, std::string_view first) {
    return !words.empty() && words[0] == first;
  }

  template <class Table>
  auto find(const Table& table, const std::string& name) const {
    std::vector<std::string> names;
    for (const auto& [known, entry] : table) {
      if (known == name) return entry;
      names.emplace_back(known);
    }
    fail(fmt::format("has the unknown word '{}'; {}", name, hint(name, names)));
  }

  /// The words of the next line, which must have an end.
  std::vector<std::string> next_line() {
    ++line_;
    const std::size_t end = bytes_.find('\n', position_);
    if (end == std::string_view::npos) throw InputError("its header has no end");
    const std::string_view text = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    return split(text, " \t\r");
  }

  void read(const std::vector<std::string>& words) {
    if (words.empty() || is(words, "comment") || is(words, "obj_info")) return;
    if (is(words, "format") && words.size() == 3)
      read_format(words[1]);
    else if (is(words, "element") && words.size() == 3)
      read_element(words[1], words[2]);
    else if (is(words, "property") && words.size() == 3)
      add_property({words[2], find(kPlyTypes, words[1]), std::nullopt});
    else if (is(words, "property") && words.size() == 5 && words[1] == "list")
      add_property({words[4], find(kPlyTypes, words[3]), find(kPlyTypes, words[2])});
    else
      fail("is not understood");
  }

  void read_format(const std::string& name) {
    header_.encoding = find(kPlyEncodings, name);
    has_format_ = true;
  }

  void read_element(const std::string& name, const std::string& count) {
    PlyElement element{name, 0, {}};
    const char* const end = count.data() + count.size();
    const auto [stop, error] = std::from_chars(count.data(), end, element.count);
    if (error != std::errc() || stop != end) fail("has no number of elements");
    header_.elements.push_back(std::move(element));
  }

  void add_property(PlyProperty property) {
    if (header_.elements.empty()) fail("belongs to no element");
    header_.elements.back().properties.push_back(std::move(property));
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw LineError(line_, "this line of the header " + message);
  }

  std::string_view bytes_;
  std::size_t position_ = 0;
  int line_ = 0;
  bool has_format_ = false;
  PlyHeader header_;
};

}  // namespace

std::size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::Int8:
    case PlyType::UInt8:
      return 1;
    case PlyType::Int16:
    case PlyType::UInt16:
      return 2;
    case PlyType::Int32:
    case PlyType::UInt32:
    case PlyType::Float32:
      return 4;
    case PlyType::Float64:
      return 8;
  }
  return 0;
}

PlyHeader read_ply_header(std::string_view bytes) { return PlyHeaderReader(bytes).read(); }

}  // namespace driftlight
