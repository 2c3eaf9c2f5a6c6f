// SPDX-License-Identifier: Apache-2.0
#include "mesh_serialized.h"

#include <zlib.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <string>
#include <type_traits>

#include "driftlight/error.h"

// A .serialized file is a sequence of meshes, then the offsets of them all (64 bits each, 32 in
// version 3), then their number (32 bits). A mesh is the 16-bit numbers 0x041C and the version,
// followed by a zlib stream. All is little-endian.
//
// Versions 3 and 4: flags (32 bits), in version 4 a name that ends with a zero, the numbers of
// vertices and of triangles (64 bits each), positions, normals, texture coordinates and colours as
// the flags say, and three 32-bit indices a triangle.
//
// Version 5, of Mitsuba 3: flags, a name, the numbers of vertices, triangles, distinct positions
// and distinct normals (64 bits each; the latter two may be 0), a record of eight floats a vertex
// (position, normal or frame, texture coordinates), one of four 32-bit numbers a triangle (three
// indices and marks of its own), of each vertex the index of its position and that of its normal,
// where their number is not 0, and the number of attributes (32 bits). These have each a name, a
// byte (1: coefficients of spectra), the size of a value (32 bits) and the floats, of all triangles
// if the name begins with "face_", else of all vertices. Names have their length (32 bits) first.

namespace driftlight {
namespace {

static_assert(std::endian::native == std::endian::little, "the reader copies bytes as they are");

constexpr std::uint16_t kMagic = 0x041C;

// Flags.
constexpr std::uint32_t kHasNormals = 0x0001;
constexpr std::uint32_t kHasTexCoords = 0x0002;
constexpr std::uint32_t kHasColors = 0x0008;
constexpr std::uint32_t kDoublePrecision = 0x2000;

// Those of version 5.
constexpr std::uint32_t kRecordNormals = 0x0001;
constexpr std::uint32_t kRecordFrames = 0x0002;
constexpr std::uint32_t kRecordTexCoords = 0x0004;
constexpr std::uint32_t kFaceNormals = 0x0010;
constexpr std::uint32_t kSinglePrecision = 0x1000;

/// The bytes of a file, read at any place.
class BinaryFile {
 public:
  explicit BinaryFile(const std::filesystem::path& file) : stream_(file, std::ios::binary) {
    if (!stream_ || std::filesystem::is_directory(file)) throw InputError("it cannot be opened");
    size_ = std::filesystem::file_size(file);
  }

  std::uint64_t size() const { return size_; }

  std::string read(std::uint64_t offset, std::uint64_t count) {
    if (offset > size_ || count > size_ - offset) throw InputError("it is truncated");
    std::string result(count, '\0');
    stream_.seekg(static_cast<std::streamoff>(offset));
    if (!stream_.read(result.data(), static_cast<std::streamsize>(count)))
      throw InputError("it cannot be read");
    return result;
  }

  template <class T>
  T number(std::uint64_t offset) {
    T result;
    std::memcpy(&result, read(offset, sizeof(T)).data(), sizeof(T));
    return result;
  }

 private:
  std::ifstream stream_;
  std::uint64_t size_ = 0;
};

/// Decompresses the zlib stream that begins at some place of a file, piece by piece.
class InflateStream {
 public:
  InflateStream(BinaryFile& file, std::uint64_t offset) : file_(file), offset_(offset) {
    if (inflateInit(&stream_) != Z_OK) throw RuntimeError("zlib cannot be initialised");
  }
  ~InflateStream() { inflateEnd(&stream_); }
  InflateStream(const InflateStream&) = delete;
  InflateStream& operator=(const InflateStream&) = delete;

  /// Throws InputError unless `count` elements of `size` bytes can be in the stream. It bounds what
  /// a corrupt header can make us allocate: deflate never expands more than 1032 times.
  void expect(std::uint64_t count, std::uint64_t size) const {
    if (count > 1032 * file_.size() / size)
      throw InputError("it is corrupt: it says that it has " + std::to_string(count) +
                       " elements, which is more than its size allows");
  }

  void read(void* target, std::size_t size) {
    stream_.next_out = static_cast<Bytef*>(target);
    while (size > 0) {
      const auto piece = static_cast<uInt>(std::min<std::size_t>(size, 1U << 30U));
      stream_.avail_out = piece;
      inflate_some();
      size -= piece - stream_.avail_out;
      if (ended_ && size > 0) throw InputError("it is truncated");
    }
  }

  template <class T>
  T number() {
    T result;
    read(&result, sizeof(T));
    return result;
  }

  /// As many bytes as the number before them says.
  std::string text() {
    const auto length = number<std::uint32_t>();
    expect(length, 1);
    std::string result(length, '\0');
    read(result.data(), length);
    return result;
  }

  /// `count` elements of `size` bytes.
  void skip(std::uint64_t count, std::uint64_t size) {
    if (size == 0) return;
    expect(count, size);
    std::array<char, 4096> piece;
    for (std::uint64_t left = count * size; left > 0;) {
      const std::uint64_t now = std::min<std::uint64_t>(left, piece.size());
      read(piece.data(), now);
      left -= now;
    }
  }

  /// Reads the checksum after the last byte, by asking for one byte more.
  void check_sum() {
    Bytef extra = 0;
    stream_.next_out = &extra;
    stream_.avail_out = 1;
    while (!ended_ && stream_.avail_out > 0) inflate_some();
  }

 private:
  void inflate_some() {
    if (stream_.avail_in == 0 && !ended_) refill();
    const int status = inflate(&stream_, Z_NO_FLUSH);
    ended_ = status == Z_STREAM_END;
    if (status != Z_OK && !ended_) throw InputError("its compressed data is corrupt");
  }

  void refill() {
    constexpr std::uint64_t kPiece = 1U << 16U;
    const std::uint64_t size = std::min(kPiece, file_.size() - offset_);
    if (size == 0) throw InputError("it is truncated");
    piece_ = file_.read(offset_, size);
    offset_ += size;
    stream_.next_in = reinterpret_cast<Bytef*>(piece_.data());
    stream_.avail_in = static_cast<uInt>(size);
  }

  BinaryFile& file_;
  std::uint64_t offset_;  ///< of what has not been read
  std::string piece_;     ///< what is being decompressed
  z_stream stream_{};
  bool ended_ = false;
};

template <class File, int N>
std::vector<Eigen::Matrix<float, N, 1>> read_vectors(InflateStream& stream, std::size_t count) {
  stream.expect(count, N * sizeof(File));
  std::vector<Eigen::Matrix<File, N, 1>> values(count);
  stream.read(values.data(), count * N * sizeof(File));
  if constexpr (std::is_same_v<File, float>) return values;
  std::vector<Eigen::Matrix<float, N, 1>> result;
  result.reserve(count);
  for (const auto& value : values) result.push_back(value.template cast<float>());
  return result;
}

template <class File>
void read_vertices(InflateStream& stream, std::uint32_t flags, std::size_t count,
                   ColoredMesh& file) {
  TriangleMesh& mesh = file.mesh;
  mesh.positions = read_vectors<File, 3>(stream, count);
  if (flags & kHasNormals) mesh.normals = read_vectors<File, 3>(stream, count);
  if (flags & kHasTexCoords) mesh.uvs = read_vectors<File, 2>(stream, count);
  if (flags & kHasColors) file.colors = read_vectors<File, 3>(stream, count);
}

ColoredMesh read_mesh(InflateStream& stream, std::uint16_t version) {
  const auto flags = stream.number<std::uint32_t>();
  if (version == 4)
    while (stream.number<char>() != '\0') continue;  // the name
  const auto vertices = stream.number<std::uint64_t>();
  const auto triangles = stream.number<std::uint64_t>();
  ColoredMesh file;
  TriangleMesh& mesh = file.mesh;
  if (flags & kDoublePrecision)
    read_vertices<double>(stream, flags, vertices, file);
  else
    read_vertices<float>(stream, flags, vertices, file);
  stream.expect(triangles, sizeof(mesh.triangles[0]));
  mesh.triangles.resize(triangles);
  stream.read(mesh.triangles.data(), triangles * sizeof(mesh.triangles[0]));
  stream.check_sum();
  check_mesh(mesh);
  return file;
}

/// Takes the records of the vertices apart.
void unpack(const std::vector<Eigen::Matrix<float, 8, 1>>& records, std::uint32_t flags,
            TriangleMesh& mesh) {
  for (const auto& record : records) {
    mesh.positions.emplace_back(record.head<3>());
    const Eigen::Vector3f p = record.segment<3>(3);
    // The rotation by the quaternion (1 - p.p, 2 p) takes z to the normal, and x to the tangent.
    if (flags & kRecordFrames)
      mesh.normals.emplace_back(
          Eigen::Quaternionf(1.0F - p.squaredNorm(), 2.0F * p.x(), 2.0F * p.y(), 2.0F * p.z())
              .normalized() *
          Eigen::Vector3f(0, 0, 1));
    else if (flags & kRecordNormals)
      mesh.normals.push_back(p);
    if (flags & kRecordTexCoords) mesh.uvs.emplace_back(record.tail<2>());
  }
}

/// Of attributes only the colours of vertices.
void read_attributes(InflateStream& stream, std::uint64_t vertices, std::uint64_t triangles,
                     ColoredMesh& file) {
  const auto attributes = stream.number<std::uint32_t>();
  for (std::uint32_t i = 0; i < attributes; ++i) {
    const std::string name = stream.text();
    const bool spectral = (stream.number<std::uint8_t>() & 1U) != 0;
    const auto size = stream.number<std::uint32_t>();
    if (name == "vertex_color" && size == 3 && !spectral)
      file.colors = read_vectors<float, 3>(stream, vertices);
    else
      stream.skip(name.starts_with("face_") ? triangles : vertices, sizeof(float) * size);
  }
}

ColoredMesh read_packed_mesh(InflateStream& stream) {
  const auto flags = stream.number<std::uint32_t>();
  if (!(flags & kSinglePrecision)) throw InputError("its numbers are not of single precision");
  stream.text();  // the name
  const auto vertices = stream.number<std::uint64_t>();
  const auto triangles = stream.number<std::uint64_t>();
  const auto positions = stream.number<std::uint64_t>();
  const auto normals = stream.number<std::uint64_t>();
  ColoredMesh file;
  TriangleMesh& mesh = file.mesh;
  unpack(read_vectors<float, 8>(stream, vertices), flags, mesh);
  stream.expect(triangles, 4 * sizeof(std::uint32_t));
  mesh.triangles.resize(triangles);
  for (auto& triangle : mesh.triangles) {
    stream.read(triangle.data(), sizeof(triangle));
    stream.number<std::uint32_t>();
  }
  if (positions > 0) stream.skip(vertices, sizeof(std::uint32_t));
  if (normals > 0) stream.skip(vertices, sizeof(std::uint32_t));
  read_attributes(stream, vertices, triangles, file);
  stream.check_sum();
  file.face_normals = (flags & kFaceNormals) != 0;
  check_mesh(mesh);
  return file;
}

/// Where mesh `index` begins. The first needs no table of offsets, and may have none.
std::uint64_t find_mesh(BinaryFile& file, std::uint16_t version, std::uint64_t index) {
  if (index == 0) return 0;
  constexpr std::uint64_t kCountSize = sizeof(std::uint32_t);
  const std::uint64_t offset_size = version == 3 ? 4 : 8;
  const auto count = file.number<std::uint32_t>(file.size() - kCountSize);
  if (index >= count)
    throw InputError("it has no mesh " + std::to_string(index) + ": it says that it has " +
                     std::to_string(count));
  const std::uint64_t table_size = kCountSize + count * offset_size;
  if (table_size > file.size()) throw InputError("it is truncated");
  const std::uint64_t entry = file.size() - table_size + index * offset_size;
  return version == 3 ? file.number<std::uint32_t>(entry) : file.number<std::uint64_t>(entry);
}

std::uint16_t read_version(BinaryFile& file, std::uint64_t offset) {
  if (file.number<std::uint16_t>(offset) != kMagic) throw InputError("it has no mesh header");
  const auto version = file.number<std::uint16_t>(offset + 2);
  if (version < 3 || version > 5)
    throw InputError("its version " + std::to_string(version) + " is not 3, 4 or 5");
  return version;
}

}  // namespace

ColoredMesh read_serialized(const std::filesystem::path& file, int shape_index) {
  try {
    if (shape_index < 0) throw InputError("a shapeIndex must not be negative");
    BinaryFile bytes(file);
    const auto index = static_cast<std::uint64_t>(shape_index);
    const std::uint64_t offset = find_mesh(bytes, read_version(bytes, 0), index);
    const std::uint16_t version = read_version(bytes, offset);
    InflateStream stream(bytes, offset + 4);
    return version == 5 ? read_packed_mesh(stream) : read_mesh(stream, version);
  } catch (const InputError& error) {
    throw InputError("the mesh file '" + file.string() + "' is not usable: " + error.what());
  }
}

}  // namespace driftlight
