// SPDX-License-Identifier: Apache-2.0
#include "mesh_obj.h"

#include <tiny_obj_loader.h>

#include <array>
#include <fstream>
#include <map>
#include <string>

#include "driftlight/error.h"
#include "mesh.h"

namespace driftlight {
namespace {

/// Collects what the parser calls back with.
class ObjReader {
 public:
  explicit ObjReader(const ObjOptions& options) : options_(options) {}

  void add_position(float x, float y, float z) { positions_.emplace_back(x, y, z); }
  void add_normal(float x, float y, float z) { normals_.emplace_back(x, y, z); }
  void add_uv(float u, float v) { uvs_.emplace_back(u, options_.flip_tex_coords ? 1 - v : v); }

  /// A fan, as Mitsuba makes of polygons.
  void add_polygon(const tinyobj::index_t* corners, int count) {
    if (count < 3) throw InputError("a face has fewer than three corners");
    std::vector<std::uint32_t> vertices;
    vertices.reserve(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) vertices.push_back(vertex(corners[i]));
    for (std::size_t i = 2; i < vertices.size(); ++i)
      mesh_.triangles.push_back({vertices[0], vertices[i - 1], vertices[i]});
  }

  void start_group() {
    if (!options_.one_mesh) finish_mesh();
  }
  void start_material(const std::string& name) {
    start_group();
    material_ = name.substr(0, name.find_last_not_of(" \t\r") + 1);
  }
  void set_library(const std::string& name) { file_.library = name; }

  ObjFile take() {
    finish_mesh();
    if (file_.parts.empty()) throw InputError("the file has no faces");
    return std::move(file_);
  }

 private:
  /// Position, normal and texture coordinates; the latter two zero where absent.
  using Key = std::array<float, 8>;

  /// From 1, or from the end if negative, to an index from 0.
  template <class T>
  static std::size_t index(int from_one, const std::vector<T>& values, const std::string& what) {
    const auto size = static_cast<long long>(values.size());
    const long long i = from_one < 0 ? size + from_one : from_one - 1LL;
    if (i < 0 || i >= size)
      throw InputError("a face refers to " + what + " " + std::to_string(from_one) +
                       ", but there are only " + std::to_string(size));
    return static_cast<std::size_t>(i);
  }

  std::uint32_t vertex(const tinyobj::index_t& corner) {
    const Eigen::Vector3f p = positions_[index(corner.vertex_index, positions_, "vertex")];
    Eigen::Vector3f n = Eigen::Vector3f::Zero();
    Eigen::Vector2f uv = Eigen::Vector2f::Zero();
    if (corner.normal_index != 0) n = normals_[index(corner.normal_index, normals_, "normal")];
    if (corner.texcoord_index != 0)
      uv = uvs_[index(corner.texcoord_index, uvs_, "texture coordinate")];
    (corner.normal_index != 0 ? has_normals_ : lacks_normals_) = true;
    has_uvs_ |= corner.texcoord_index != 0;

    const Key key{p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), uv.x(), uv.y()};
    const auto next = static_cast<std::uint32_t>(mesh_.positions.size());
    const auto [entry, is_new] = vertices_.emplace(key, next);
    if (is_new) {
      mesh_.positions.push_back(p);
      mesh_.normals.push_back(n);
      mesh_.uvs.push_back(uv);
    }
    return entry->second;
  }

  void finish_mesh() {
    if (mesh_.triangles.empty()) return;
    if (has_normals_ && lacks_normals_)
      throw InputError("some faces of a group have normals and others have not");
    if (!has_normals_) mesh_.normals.clear();
    if (!has_uvs_) mesh_.uvs.clear();
    check_mesh(mesh_);
    file_.parts.push_back({std::move(mesh_), material_});
    mesh_ = {};
    vertices_.clear();
    has_normals_ = lacks_normals_ = has_uvs_ = false;
  }

  ObjOptions options_;
  std::vector<Eigen::Vector3f> positions_;
  std::vector<Eigen::Vector3f> normals_;
  std::vector<Eigen::Vector2f> uvs_;
  ObjFile file_;
  TriangleMesh mesh_;
  std::string material_;
  std::map<Key, std::uint32_t> vertices_;
  bool has_normals_ = false;
  bool lacks_normals_ = false;
  bool has_uvs_ = false;
};

ObjReader& reader(void* user_data) { return *static_cast<ObjReader*>(user_data); }

tinyobj::callback_t callbacks() {
  tinyobj::callback_t result;
  result.vertex_cb = [](void* data, float x, float y, float z, float) {
    reader(data).add_position(x, y, z);
  };
  result.normal_cb = [](void* data, float x, float y, float z) {
    reader(data).add_normal(x, y, z);
  };
  result.texcoord_cb = [](void* data, float u, float v, float) { reader(data).add_uv(u, v); };
  result.index_cb = [](void* data, tinyobj::index_t* corners, int count) {
    reader(data).add_polygon(corners, count);
  };
  result.group_cb = [](void* data, const char**, int) { reader(data).start_group(); };
  result.usemtl_cb = [](void* data, const char* name, int) { reader(data).start_material(name); };
  return result;
}

/// Notes the names of .mtl files and reads none.
class LibraryNames : public tinyobj::MaterialReader {
 public:
  explicit LibraryNames(ObjReader& reader) : reader_(reader) {}
  bool operator()(const std::string& name, std::vector<tinyobj::material_t>*,
                  std::map<std::string, int>*, std::string*, std::string*) override {
    reader_.set_library(name);
    return true;
  }

 private:
  ObjReader& reader_;
};

}  // namespace

ObjFile read_obj(const std::filesystem::path& file, const ObjOptions& options) {
  std::ifstream stream(file);
  if (!stream || std::filesystem::is_directory(file))
    throw InputError("the mesh '" + file.string() + "' cannot be opened");
  try {
    ObjReader reader(options);
    LibraryNames libraries(reader);
    tinyobj::LoadObjWithCallback(stream, callbacks(), &reader, &libraries);
    return reader.take();
  } catch (const InputError& error) {
    throw InputError("the mesh '" + file.string() + "' is not usable: " + error.what());
  }
}

}  // namespace driftlight
