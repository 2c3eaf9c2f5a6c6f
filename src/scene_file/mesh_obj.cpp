// SPDX-License-Identifier: Apache-2.0
#include "mesh_obj.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <istream>
#include <iterator>
#include <string>

#include "driftlight/error.h"
#include "excerpt.h"
#include "mesh.h"
#include "obj_text.h"

namespace driftlight {
namespace {

/// Reads whole lines, 128 KiB or somewhat more; none at the end.
void read_lines(std::istream& stream, std::string& lines) {
  constexpr std::size_t kSize = std::size_t{1} << 17U;
  lines.resize(kSize);
  stream.read(lines.data(), static_cast<std::streamsize>(lines.size()));
  lines.resize(static_cast<std::size_t>(stream.gcount()));
  std::string rest;
  if (std::getline(stream, rest)) lines.append(rest).push_back('\n');
}

/// Makes meshes of pieces, in the order of the file.
class ObjReader {
 public:
  /// Of a file of so many bytes.
  ObjReader(const ObjOptions& options, std::uintmax_t file_size) : options_(options) {
    // A line is mostly longer. Memory that is reserved and not used costs nothing, up to a limit;
    // what grows is touched twice.
    constexpr std::size_t kMost = std::size_t{1} << 26U;
    const std::size_t lines = std::min<std::size_t>(file_size / 32, kMost);
    positions_.reserve(lines);
    seen_.reserve(lines);
    mesh_.positions.reserve(lines);
    mesh_.triangles.reserve(lines);
  }

  /// Throws LineError.
  void add(const ObjPiece& piece) {
    ObjPiece::Counts taken;
    for (const ObjPiece::Statement& statement : piece.statements) {
      add_values(piece, taken, statement.before);
      taken = statement.before;
      line_ = lines_ + statement.line;
      switch (statement.kind) {
        case ObjPiece::Kind::Polygons:
          add_polygons(&piece.corners[statement.first], statement);
          break;
        case ObjPiece::Kind::Group:
          start_group();
          break;
        case ObjPiece::Kind::Material:
          start_group();
          material_ = piece.names[statement.first];
          break;
        case ObjPiece::Kind::Library:
          file_.library = piece.names[statement.first];
          break;
      }
    }
    if (piece.problem) throw LineError(lines_ + piece.problem->line, piece.problem->message);
    const auto size = [](const auto& values) { return static_cast<std::uint32_t>(values.size()); };
    add_values(piece, taken, {size(piece.positions), size(piece.normals), size(piece.uvs)});
    lines_ += piece.line_count;
  }

  ObjFile take() {
    finish_mesh();
    if (file_.parts.empty()) throw InputError("the file has no faces");
    return std::move(file_);
  }

 private:
  /// Indices from 0; kNone where a corner has no normal or texture coordinates.
  struct Corner {
    std::uint32_t position, normal, uv;
  };
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  /// The last corner at a position, by its part of the file, counted from 1, and its vertex there.
  struct Seen {
    std::uint32_t part = 0;
    std::uint32_t normal = kNone;
    std::uint32_t uv = kNone;
    std::uint32_t vertex = 0;
  };

  void add_values(const ObjPiece& piece, const ObjPiece::Counts& from, const ObjPiece::Counts& to) {
    positions_.insert(positions_.end(), piece.positions.begin() + from.positions,
                      piece.positions.begin() + to.positions);
    seen_.resize(positions_.size());
    normals_.insert(normals_.end(), piece.normals.begin() + from.normals,
                    piece.normals.begin() + to.normals);
    for (std::size_t i = from.uvs; i < to.uvs; ++i) {
      const Eigen::Vector2f& uv = piece.uvs[i];
      uvs_.emplace_back(uv.x(), options_.flip_tex_coords ? 1 - uv.y() : uv.y());
    }
  }

  void add_polygons(const ObjPiece::Corner* corners, const ObjPiece::Statement& polygons) {
    for (std::uint32_t i = 0; i < polygons.count; ++i, ++line_)
      add_polygon(corners + std::size_t{i} * polygons.corners, polygons.corners);
  }
  /// A fan, as Mitsuba makes of polygons.
  void add_polygon(const ObjPiece::Corner* corners, std::size_t count) {
    const std::uint32_t first = vertex(corners[0]);
    std::uint32_t last = vertex(corners[1]);
    for (std::size_t i = 2; i < count; ++i) {
      const std::uint32_t next = vertex(corners[i]);
      mesh_.triangles.push_back({first, last, next});
      last = next;
    }
  }

  void start_group() {
    if (!options_.one_mesh) finish_mesh();
  }

  /// From 1, or from the end if negative, to an index from 0.
  template <class T>
  std::uint32_t index(int from_one, const std::vector<T>& values, const char* what) const {
    const auto size = static_cast<long long>(values.size());
    const long long i = from_one < 0 ? size + from_one : from_one - 1LL;
    if (i < 0 || i >= size)
      throw LineError(line_, "a face refers to " + std::string(what) + " " +
                                 std::to_string(from_one) + ", but there are only " +
                                 std::to_string(size));
    return static_cast<std::uint32_t>(i);
  }

  /// A new vertex, unless the corner is the one last seen at its position, as most are.
  std::uint32_t vertex(const ObjPiece::Corner& indices) {
    Corner corner{index(indices.position, positions_, "vertex"), kNone, kNone};
    if (indices.normal != 0) corner.normal = index(indices.normal, normals_, "normal");
    if (indices.uv != 0) corner.uv = index(indices.uv, uvs_, "texture coordinate");
    Seen& seen = seen_[corner.position];
    const auto part = static_cast<std::uint32_t>(file_.parts.size() + 1);
    if (seen.part != part || seen.normal != corner.normal || seen.uv != corner.uv)
      seen = {part, corner.normal, corner.uv, new_vertex(corner)};
    return seen.vertex;
  }

  std::uint32_t new_vertex(const Corner& corner) {
    add_to_vertex(mesh_.normals, normals_, corner.normal);
    add_to_vertex(mesh_.uvs, uvs_, corner.uv);
    mesh_.positions.push_back(positions_[corner.position]);
    return static_cast<std::uint32_t>(mesh_.positions.size() - 1);
  }

  /// Zero where absent; if no vertex of the mesh has any so far, there are none.
  template <class Vector>
  void add_to_vertex(std::vector<Vector>& of_mesh, const std::vector<Vector>& values,
                     std::uint32_t i) {
    if (of_mesh.empty() && i == kNone) return;
    of_mesh.resize(mesh_.positions.size(), Vector::Zero());
    of_mesh.push_back(i == kNone ? Vector(Vector::Zero()) : values[i]);
  }

  void finish_mesh() {
    if (mesh_.triangles.empty()) return;
    check_mesh(mesh_);
    merge_equal_vertices(mesh_);
    file_.parts.push_back({std::move(mesh_), material_});
    mesh_ = {};
  }

  ObjOptions options_;
  int lines_ = 0;  ///< of the pieces before
  int line_ = 0;   ///< of the statement
  std::vector<Eigen::Vector3f> positions_;
  std::vector<Eigen::Vector3f> normals_;
  std::vector<Eigen::Vector2f> uvs_;
  ObjFile file_;
  TriangleMesh mesh_;
  std::string material_;
  std::vector<Seen> seen_;  ///< at each position
};

/// What some programs put before a text in UTF-8.
void skip_byte_order_mark(std::istream& stream) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  std::string start(kMark.size(), '\0');
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  stream.clear();
  if (start != kMark) stream.seekg(0);
}

/// Some lines, and what they say.
struct Portion {
  std::string lines;
  ObjPiece piece;
};

/// Portions are parsed side by side, some at a time, in the same memory over and over.
ObjFile read_portions(std::istream& stream, std::uintmax_t file_size, const ObjOptions& options) {
  constexpr std::size_t kAtATime = 8;
  // All end in order: when one begins that which had its place has ended.
  std::array<Portion, kAtATime> places;
  std::size_t begun = 0;
  ObjReader reader(options, file_size);
  skip_byte_order_mark(stream);
  const auto read = [&](tbb::flow_control& control) {
    Portion& portion = places[begun++ % kAtATime];
    read_lines(stream, portion.lines);
    if (portion.lines.empty()) control.stop();
    return &portion;
  };
  const auto parse = [](Portion* portion) {
    parse_obj(portion->lines, portion->piece);
    return portion;
  };
  const auto add = [&](const Portion* portion) { reader.add(portion->piece); };
  using enum tbb::filter_mode;
  tbb::parallel_pipeline(kAtATime, tbb::make_filter<void, Portion*>(serial_in_order, read) &
                                       tbb::make_filter<Portion*, Portion*>(parallel, parse) &
                                       tbb::make_filter<Portion*, void>(serial_in_order, add));
  return reader.take();
}

}  // namespace

ObjFile read_obj(const std::filesystem::path& file, const ObjOptions& options) {
  std::ifstream stream(file);
  if (!stream || std::filesystem::is_directory(file))
    throw InputError("the mesh '" + file.string() + "' cannot be opened");
  try {
    const bool has_size = std::filesystem::is_regular_file(file);  // a pipe has none
    return read_portions(stream, has_size ? std::filesystem::file_size(file) : 0, options);
  } catch (const LineError& error) {
    std::ifstream again(file, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(again), std::istreambuf_iterator<char>()};
    throw InputError(problem_in_line(file, text, error.line(), error.what()));
  } catch (const InputError& error) {
    throw InputError("the mesh '" + file.string() + "' is not usable: " + error.what());
  }
}

}  // namespace driftlight
