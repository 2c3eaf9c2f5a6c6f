// SPDX-License-Identifier: Apache-2.0
#include "mesh_serialized.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <string>
#include <type_traits>

#include "driftlight/error.h"

// A .serialized file is a sequence of meshes, then the offsets of them all (64 bits each, 32 in
// version 3), then their number (32 bits). A mesh is the 16-bit numbers 0x041C and the version,
// followed by a zlib stream of: flags (32 bits), in version 4 a name that ends with a zero, the
// numbers of vertices and of triangles (64 bits each), positions, normals, texture coordinates and
// colours as the flags say, and three 32-bit indices a triangle. All is little-endian.

namespace driftlight {
namespace {

static_assert(std::endian::native == std::endian::little, "the reader copies bytes as they are");

constexpr std::uint16_t kMagic = 0x041C;

// Flags.
constexpr std::uint32_t kHasNormals = 0x0001;
constexpr std::uint32_t kHasTexCoords = 0x0002;
constexpr std::uint32_t kHasColors = 0x0008;
constexpr std::uint32_t kDoublePrecision = 0x2000;

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

/// Where mesh `index` begins. The first needs no table of offsets, and may have none.
std::uint64_t find_mesh(BinaryFile& file, std::uint16_t version, std::uint64_t index) {
  if (index == 0) return 0;
  constexpr std::uint64_t kCountSize = sizeof(std::uint32_t);
  const std::uint64_t offset_size = version == 4 ? 8 : 4;
  const auto count = file.number<std::uint32_t>(file.size() - kCountSize);
  if (index >= count)
    throw InputError("it has no mesh " + std::to_string(index) + ": it says that it has " +
                     std::to_string(count));
  const std::uint64_t table_size = kCountSize + count * offset_size;
  if (table_size > file.size()) throw InputError("it is truncated");
  const std::uint64_t entry = file.size() - table_size + index * offset_size;
  return version == 4 ? file.number<std::uint64_t>(entry) : file.number<std::uint32_t>(entry);
}

std::uint16_t read_version(BinaryFile& file, std::uint64_t offset) {
  if (file.number<std::uint16_t>(offset) != kMagic) throw InputError("it has no mesh header");
  const auto version = file.number<std::uint16_t>(offset + 2);
  if (version != 3 && version != 4)
    throw InputError("its version " + std::to_string(version) + " is not 3 or 4");
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
    return read_mesh(stream, version);
  } catch (const InputError& error) {
    throw InputError("the mesh file '" + file.string() + "' is not usable: " + error.what());
  }
}

}  // namespace driftlight
