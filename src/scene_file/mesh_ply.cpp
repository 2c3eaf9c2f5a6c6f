// SPDX-License-Identifier: Apache-2.0
#include "mesh_ply.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <string_view>

#include "driftlight/error.h"
#include "excerpt.h"
#include "ply_header.h"
#include "text.h"

namespace driftlight {
namespace {

/// Bytes of a row in binary, if its lists have so many values.
std::size_t row_size(const PlyElement& element, std::size_t values_of_list) {
  std::size_t size = 0;
  for (const PlyProperty& property : element.properties)
    size += property.count_type
                ? size_of(*property.count_type) + values_of_list * size_of(property.type)
                : size_of(property.type);
  return size;
}

/// The values that follow the header, one by one.
class PlyValues {
 public:
  PlyValues(std::string_view bytes, PlyEncoding encoding) : bytes_(bytes), encoding_(encoding) {}

  double next(PlyType type) {
    if (encoding_ == PlyEncoding::Ascii) return next_word();
    switch (type) {
      case PlyType::Int8:
        return next_bytes<std::int8_t>();
      case PlyType::UInt8:
        return next_bytes<std::uint8_t>();
      case PlyType::Int16:
        return next_bytes<std::int16_t>();
      case PlyType::UInt16:
        return next_bytes<std::uint16_t>();
      case PlyType::Int32:
        return next_bytes<std::int32_t>();
      case PlyType::UInt32:
        return next_bytes<std::uint32_t>();
      case PlyType::Float32:
        return static_cast<double>(next_bytes<float>());
      case PlyType::Float64:
        return next_bytes<double>();
    }
    return 0.0;
  }

  /// Of a text it must fit.
  float next_float(PlyType type) {
    const double value = next(type);
    const auto result = static_cast<float>(value);
    if (is_text() && !std::isfinite(result))
      throw InputError(fmt::format("{:g} does not fit single precision", value));
    return result;
  }

  /// Throws InputError unless there can be `count` rows of so many bytes (binary) or values (text)
  /// each. It bounds what a corrupt header can make us allocate.
  void expect(const PlyElement& element) const {
    const std::size_t row = is_text() ? element.properties.size() : row_size(element, 0);
    if (row > 0 && element.count > bytes_.size() / row)
      throw InputError(
          fmt::format("it is truncated: it says that it has {} elements '{}', which is more than "
                      "its size allows",
                      element.count, element.name));
  }

  bool is_text() const { return encoding_ == PlyEncoding::Ascii; }
  /// Where the last word of a text begins.
  const char* last_word() const { return last_word_; }
  std::size_t size() const { return bytes_.size(); }
  /// Those that follow after so many bytes.
  PlyValues after(std::size_t bytes) const { return {bytes_.substr(bytes), encoding_}; }

  /// The number of values of a list, which are still to come.
  std::size_t next_count(PlyType type) {
    const double count = next(type);
    if (!(count >= 0.0 && count <= static_cast<double>(bytes_.size())))
      throw InputError("it is truncated: a list is longer than the file");
    return static_cast<std::size_t>(count);
  }

 private:
  template <class T>
  T next_bytes() {
    if (bytes_.size() < sizeof(T)) throw InputError("it is truncated");
    std::array<char, sizeof(T)> bytes{};
    std::copy_n(bytes_.begin(), sizeof(T), bytes.begin());
    bytes_.remove_prefix(sizeof(T));
    const bool is_little = encoding_ == PlyEncoding::LittleEndian;
    if (is_little != (std::endian::native == std::endian::little))
      std::reverse(bytes.begin(), bytes.end());
    T result;
    std::memcpy(&result, bytes.data(), sizeof(T));
    return result;
  }

  double next_word() {
    constexpr std::string_view kBlanks = " \t\r\n";
    bytes_.remove_prefix(std::min(bytes_.find_first_not_of(kBlanks), bytes_.size()));
    if (bytes_.empty()) throw InputError("it is truncated");
    const std::string_view word = bytes_.substr(0, bytes_.find_first_of(kBlanks));
    last_word_ = word.data();
    bytes_.remove_prefix(word.size());
    if (const auto number = parse_number(word)) return *number;
    throw InputError(fmt::format("'{}' is not a finite number", word.substr(0, 40)));
  }

  std::string_view bytes_;
  PlyEncoding encoding_;
  const char* last_word_ = nullptr;
};

/// Where a property of a vertex belongs: x, y, z, nx, ny, nz, u, v, red, green, blue.
constexpr std::size_t kSlotCount = 11;
std::optional<std::size_t> vertex_slot(const PlyProperty& property) {
  constexpr std::array<std::pair<std::string_view, std::size_t>, 21> kSlots{{
      {"x", 0},
      {"y", 1},
      {"z", 2},
      {"nx", 3},
      {"ny", 4},
      {"nz", 5},
      {"u", 6},
      {"v", 7},
      {"s", 6},
      {"t", 7},
      {"texture_u", 6},
      {"texture_v", 7},
      {"red", 8},
      {"green", 9},
      {"blue", 10},
      {"diffuse_red", 8},
      {"diffuse_green", 9},
      {"diffuse_blue", 10},
      {"r", 8},
      {"g", 9},
      {"b", 10},
  }};
  for (const auto& [name, slot] : kSlots)
    if (property.name == name && !property.count_type) return slot;
  return std::nullopt;
}

bool is_polygon(const PlyProperty& property) {
  return property.count_type &&
         (property.name == "vertex_indices" || property.name == "vertex_index");
}

class PlyReader {
 public:
  PlyReader(const PlyHeader& header, PlyValues values) : header_(header), values_(values) {}

  /// Where the last word of a text begins that was read; none if none was, or of a binary file.
  const char* last_word() const { return values_.last_word(); }

  PlyFile read() {
    for (const PlyElement& element : header_.elements) {
      values_.expect(element);
      if (element.name == "vertex")
        read_vertices(element);
      else if (element.name == "face")
        read_faces(element);
      else
        skip(element);
    }
    is_read_ = true;
    check_mesh(file_.mesh);
    return std::move(file_);
  }

  /// True if nothing is wrong with a line of a text, but perhaps with the whole.
  bool is_read() const { return is_read_; }

 private:
  void read_vertices(const PlyElement& element) {
    TriangleMesh& mesh = file_.mesh;
    if (!mesh.positions.empty()) throw InputError("it has two lists of vertices");
    std::vector<std::optional<std::size_t>> slots;
    std::array<bool, kSlotCount> has{};
    std::array<float, kSlotCount> unit{};
    for (const PlyProperty& property : element.properties) {
      slots.push_back(vertex_slot(property));
      if (slots.back()) {
        has.at(*slots.back()) = true;
        const bool is_whole =
            property.type != PlyType::Float32 && property.type != PlyType::Float64;
        unit.at(*slots.back()) = is_whole ? 255.0F : 1.0F;
      } else {
        file_.unused.push_back("vertex " + property.name);
      }
    }
    if (!has[0] || !has[1] || !has[2]) throw InputError("its vertices lack x, y or z");
    const bool has_normals = has[3] && has[4] && has[5];
    const bool has_uvs = has[6] && has[7];
    const bool has_colors = has[8] && has[9] && has[10];
    mesh.positions.resize(element.count);
    if (has_normals) mesh.normals.resize(element.count);
    if (has_uvs) mesh.uvs.resize(element.count);
    if (has_colors) file_.colors.resize(element.count);
    const auto read = [&](PlyValues& values, std::uint64_t i) {
      std::array<float, kSlotCount> row{};
      for (std::size_t k = 0; k < slots.size(); ++k) {
        if (slots[k])
          row.at(*slots[k]) = values.next_float(element.properties[k].type);
        else
          skip(element.properties[k], values);
      }
      mesh.positions[i] = {row[0], row[1], row[2]};
      if (has_normals) mesh.normals[i] = {row[3], row[4], row[5]};
      if (has_uvs) mesh.uvs[i] = {row[6], row[7]};
      if (has_colors) file_.colors[i] = {row[8] / unit[8], row[9] / unit[9], row[10] / unit[10]};
    };
    const bool has_lists =
        std::any_of(element.properties.begin(), element.properties.end(),
                    [](const PlyProperty& property) { return property.count_type.has_value(); });
    if (values_.is_text() || has_lists)
      for (std::uint64_t i = 0; i < element.count; ++i) read(values_, i);
    else
      read_rows(element.count, row_size(element, 0), read);
  }

  /// Rows of one size each, side by side.
  template <class Read>
  void read_rows(std::uint64_t count, std::size_t row_size, const Read& read) {
    tbb::parallel_for(tbb::blocked_range<std::uint64_t>(0, count, kRows), [&](const auto& rows) {
      PlyValues values = values_.after(rows.begin() * row_size);
      for (std::uint64_t i = rows.begin(); i < rows.end(); ++i) read(values, i);
    });
    values_ = values_.after(count * row_size);
  }

  void read_faces(const PlyElement& element) {
    if (std::none_of(element.properties.begin(), element.properties.end(), &is_polygon))
      throw InputError("its faces lack the list 'vertex_indices'");
    for (const PlyProperty& property : element.properties)
      if (!is_polygon(property)) file_.unused.push_back("face " + property.name);
    if (const auto rows = triangle_rows(element)) return read_triangles(element.count, *rows);
    file_.mesh.triangles.reserve(element.count);
    for (std::uint64_t i = 0; i < element.count; ++i)
      for (const PlyProperty& property : element.properties) {
        if (is_polygon(property))
          read_polygon(property);
        else
          skip(property, values_);
      }
  }

  /// Rows of one size each with a triangle.
  struct TriangleRows {
    std::size_t size;
    std::size_t count;  ///< where in a row the number of corners is
    PlyType count_type;
    PlyType type;  ///< of an index
  };

  /// If the rows to come are binary, each with one list, of three corners.
  std::optional<TriangleRows> triangle_rows(const PlyElement& element) const {
    const std::size_t size = row_size(element, 3);
    if (values_.is_text() || element.count > values_.size() / size) return std::nullopt;
    std::size_t before = 0;
    const PlyProperty* list = nullptr;
    for (const PlyProperty& property : element.properties) {
      if (property.count_type && (list != nullptr || !is_polygon(property))) return std::nullopt;
      if (property.count_type) list = &property;
      if (list == nullptr) before += size_of(property.type);
    }
    const TriangleRows result{size, before, *list->count_type, list->type};
    const bool are_triangles = tbb::parallel_reduce(
        tbb::blocked_range<std::uint64_t>(0, element.count, kRows), true,
        [&](const auto& rows, bool all) {
          for (std::uint64_t i = rows.begin(); all && i < rows.end(); ++i)
            all = values_.after(i * size + before).next(result.count_type) == 3.0;
          return all;
        },
        std::logical_and<>());
    return are_triangles ? std::optional(result) : std::nullopt;
  }

  void read_triangles(std::uint64_t count, const TriangleRows& rows) {
    file_.mesh.triangles.resize(count);
    const std::size_t corners = rows.count + size_of(rows.count_type);
    tbb::parallel_for(tbb::blocked_range<std::uint64_t>(0, count, kRows), [&](const auto& range) {
      for (std::uint64_t i = range.begin(); i < range.end(); ++i) {
        PlyValues values = values_.after(i * rows.size + corners);
        for (std::uint32_t& index : file_.mesh.triangles[i]) index = read_index(rows.type, values);
      }
    });
    values_ = values_.after(count * rows.size);
  }

  /// A fan around the first corner.
  void read_polygon(const PlyProperty& property) {
    const std::size_t count = values_.next_count(*property.count_type);
    if (count < 3) throw InputError("a face has fewer than three corners");
    const std::uint32_t first = read_corner(property.type);
    std::uint32_t last = read_corner(property.type);
    for (std::size_t i = 2; i < count; ++i) {
      const std::uint32_t next = read_corner(property.type);
      file_.mesh.triangles.push_back({first, last, next});
      last = next;
    }
  }

  /// The index of a vertex, which of a text must be there, as long as its line is known.
  std::uint32_t read_corner(PlyType type) {
    const std::uint32_t index = read_index(type, values_);
    const std::size_t vertices = file_.mesh.positions.size();
    if (values_.is_text() && vertices > 0 && index >= vertices)
      throw InputError(
          fmt::format("a face refers to vertex {}, but there are only {}", index, vertices));
    return index;
  }

  static std::uint32_t read_index(PlyType type, PlyValues& values) {
    const double index = values.next(type);
    const auto whole = static_cast<std::uint32_t>(std::clamp(index, 0.0, 4294967295.0));
    if (static_cast<double>(whole) != index)
      throw InputError(fmt::format("a face refers to vertex {}", index));
    return whole;
  }

  void skip(const PlyElement& element) {
    if (element.properties.empty()) return;
    for (std::uint64_t i = 0; i < element.count; ++i)
      for (const PlyProperty& property : element.properties) skip(property, values_);
  }

  static void skip(const PlyProperty& property, PlyValues& values) {
    const std::size_t count = property.count_type ? values.next_count(*property.count_type) : 1;
    for (std::size_t i = 0; i < count; ++i) values.next(property.type);
  }

  static constexpr std::size_t kRows = 4096;  ///< read by one thread at a time, at least

  const PlyHeader& header_;
  PlyValues values_;
  PlyFile file_;
  bool is_read_ = false;
};

std::string read_ply_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream || std::filesystem::is_directory(file)) throw InputError("it cannot be opened");
  std::string bytes(std::filesystem::file_size(file), '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  return bytes;
}

}  // namespace

PlyFile read_ply(const std::filesystem::path& file) {
  const auto unusable = [&](const InputError& error) {
    return InputError("the mesh '" + file.string() + "' is not usable: " + error.what());
  };
  std::string bytes;
  PlyHeader header;
  try {
    bytes = read_ply_bytes(file);
    header = read_ply_header(bytes);
  } catch (const LineError& error) {
    throw InputError(problem_in_line(file, bytes, error.line(), error.what()));
  } catch (const InputError& error) {
    throw unusable(error);
  }
  const std::string_view body = std::string_view(bytes).substr(header.size);
  PlyReader reader(header, PlyValues(body, header.encoding));
  try {
    return reader.read();
  } catch (const InputError& error) {
    if (reader.last_word() == nullptr || reader.is_read()) throw unusable(error);
    const auto offset = static_cast<std::size_t>(reader.last_word() - bytes.data());
    throw InputError(problem_in_line(file, bytes, location_in(bytes, offset).line, error.what()));
  }
}

}  // namespace driftlight
