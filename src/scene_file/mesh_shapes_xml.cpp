// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "material_library.h"
#include "mesh.h"
#include "mesh_obj.h"
#include "mesh_ply.h"
#include "mesh_serialized.h"
#include "nearest_names.h"
#include "shape_readers.h"
#include "spectrum.h"

namespace driftlight {
namespace {

/// Whether meshes that are mirrored keep their outside, or turn inside out as their triangles do.
/// Mitsuba 0.6 does either, by the format; Mitsuba 3 always keeps it.
enum class Mirrored { KeepsOutside, TurnsInsideOut };

/// Properties that all meshes of files share, applied in Mitsuba's order. `faceted` is the default
/// of faceNormals. Returns how many vertices lacked a normal that others had.
std::size_t finish_mesh(Properties& properties, TriangleMesh& mesh, Mirrored mirrored,
                        bool faceted = false) {
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  transform_mesh(mesh, to_world);
  const bool keep = mirrored == Mirrored::KeepsOutside || properties.dialect() == Dialect::Mitsuba3;
  if (keep && to_world.linear().determinant() < 0.0) reverse_winding(mesh);
  const bool face_normals = properties.boolean("faceNormals", faceted);
  if (properties.has("maxSmoothAngle")) {
    if (face_normals)
      properties.fail("maxSmoothAngle", "give either 'faceNormals' or 'maxSmoothAngle'");
    split_at_creases(mesh, properties.non_negative("maxSmoothAngle", 0.0));
  }
  return finish_normals(mesh, face_normals, properties.boolean("flipNormals", false));
}

void note_missing_normals(Properties& properties, std::size_t count, LoadContext& context) {
  if (count == 0) return;
  context.notice(properties.element(),
                 fmt::format("{} vertices of '{}' have no normal and get the smooth one", count,
                             properties.required_text("filename")));
}

/// Likewise of a mesh with colours, which splitting at creases loses.
std::vector<ShapePart> finish_colored(Properties& properties, ColoredMesh&& file, Mirrored mirrored,
                                      LoadContext& context) {
  note_missing_normals(properties, finish_mesh(properties, file.mesh, mirrored, file.face_normals),
                       context);
  if (properties.has("maxSmoothAngle") && !file.colors.empty()) {
    context.notice(properties.element(), "'maxSmoothAngle' loses the colours of the vertices");
    file.colors.clear();
  }
  std::vector<ShapePart> result;  // a list of one in braces would copy the mesh
  result.push_back({std::move(file.mesh), nullptr, std::move(file.colors)});
  return result;
}

/// A file named in an obj file, beside it or among those of the scene.
std::filesystem::path find_beside(const std::filesystem::path& obj, const std::string& name,
                                  const Element& element) {
  const std::filesystem::path beside = obj.parent_path() / name;
  return std::filesystem::exists(beside) ? beside : element.find_file(name);
}

std::set<std::string> materials_of(const ObjFile& file) {
  std::set<std::string> names;
  for (const ObjFile::Part& part : file.parts)
    if (!part.material.empty()) names.insert(part.material);
  return names;
}

/// Names those of faces that neither the library nor the scene has.
void note_unknown_materials(const std::filesystem::path& obj, const ObjFile& file,
                            const MaterialLibrary& library, const Attachments& attachments,
                            const Element& element, LoadContext& context) {
  std::vector<std::string> known;
  for (const auto& [name, surface] : library) known.push_back(name);
  for (const std::string& name : materials_of(file))
    if (!library.contains(name) && !attachments.by_material.contains(name))
      context.notice(element, fmt::format("the material '{}' of '{}' is not in '{}' and is taken "
                                          "as grey, as in Mitsuba; {}",
                                          name, obj.string(), file.library, hint(name, known)));
}

/// The surfaces of the file's materials: those of its library, unless the scene has its own.
MaterialLibrary read_materials(const std::filesystem::path& obj, const ObjFile& file, bool load,
                               const Attachments& attachments, const Element& element,
                               LoadContext& context) {
  MaterialLibrary result;
  if (load && !file.library.empty() && !attachments.surface) {
    const std::filesystem::path library = find_beside(obj, file.library, element);
    if (std::filesystem::exists(library)) {
      result = read_material_library(library, element, context);
      note_unknown_materials(obj, file, result, attachments, element, context);
    } else {
      context.notice(element, "the materials '" + file.library + "' of '" + obj.string() +
                                  "' cannot be found; what has no bsdf is grey, as in Mitsuba");
    }
  }
  const std::set<std::string> occurring = materials_of(file);
  for (const auto& [name, surface] : attachments.by_material) {
    if (!occurring.contains(name))
      context.notice(element, "no face of '" + obj.string() + "' is of the material '" + name +
                                  "'; " + hint(name, {occurring.begin(), occurring.end()}));
    result[name] = surface;
  }
  return result;
}

/// The property `shapeIndex` of Mitsuba 0.6: of the groups that have faces only one, from 0.
void take_group(Properties& properties, ObjFile& file) {
  const int index = properties.integer("shapeIndex", -1);
  if (index < 0) return;
  const auto i = static_cast<std::size_t>(index);
  if (i >= file.parts.size())
    properties.fail("shapeIndex",
                    fmt::format("the file has only {} groups with faces", file.parts.size()));
  ObjFile::Part part = std::move(file.parts[i]);
  file.parts.clear();
  file.parts.push_back(std::move(part));
}

}  // namespace

std::vector<ShapePart> read_obj_shape(Properties& properties, LoadContext& context,
                                      const Attachments& attachments) {
  const std::string name = properties.required_text("filename");
  // Mitsuba 3 knows neither groups nor materials of obj files.
  const bool plain = properties.dialect() == Dialect::Mitsuba3;
  const ObjOptions options{.one_mesh = plain || properties.boolean("collapse", false),
                           .flip_tex_coords = properties.boolean("flipTexCoords", true)};
  const bool load_materials = !plain && properties.boolean("loadMaterials", true);
  const std::filesystem::path path = properties.element().find_file(name);
  ObjFile file = with_location(properties.element(), [&] { return read_obj(path, options); });
  if (!plain) take_group(properties, file);
  const MaterialLibrary materials =
      read_materials(path, file, load_materials, attachments, properties.element(), context);
  if (attachments.radiance && file.parts.size() > 1)
    properties.element().fail("'" + name +
                              "' has several groups and cannot be an emitter; set "
                              "'collapse' to true");
  std::vector<ShapePart> result;
  std::size_t without_normal = 0;
  for (ObjFile::Part& part : file.parts) {
    without_normal += finish_mesh(properties, part.mesh, Mirrored::TurnsInsideOut);
    const auto material = materials.find(part.material);
    result.push_back({std::move(part.mesh),
                      material != materials.end() ? material->second : attachments.surface});
  }
  note_missing_normals(properties, without_normal, context);
  return result;
}

std::vector<ShapePart> read_ply_shape(Properties& properties, LoadContext& context,
                                      const Attachments&) {
  const std::string name = properties.required_text("filename");
  const bool flip = properties.boolean("flipTexCoords", false);
  // In Mitsuba 0.6 colours are sRGB unless it is told otherwise, in Mitsuba 3 linear.
  const bool is_srgb = properties.boolean("srgb", properties.dialect() != Dialect::Mitsuba3);
  PlyFile file = with_location(properties.element(),
                               [&] { return read_ply(properties.element().find_file(name)); });
  if (flip)
    for (Eigen::Vector2f& uv : file.mesh.uvs) uv.y() = 1.0F - uv.y();
  if (!file.unused.empty())
    context.notice(properties.element(), fmt::format("'{}' has properties that are not used: {}",
                                                     name, join(file.unused)));
  if (is_srgb)
    for (Eigen::Vector3f& color : file.colors)
      color = color.unaryExpr(
          [](float c) { return static_cast<float>(srgb_to_linear(static_cast<double>(c))); });
  return finish_colored(properties, std::move(file), Mirrored::TurnsInsideOut, context);
}

std::vector<ShapePart> read_serialized_shape(Properties& properties, LoadContext& context,
                                             const Attachments&) {
  const std::string name = properties.required_text("filename");
  const int index = properties.integer("shapeIndex", 0);
  ColoredMesh file = with_location(properties.element(), [&] {
    return read_serialized(properties.element().find_file(name), index);
  });
  return finish_colored(properties, std::move(file), Mirrored::KeepsOutside, context);
}

}  // namespace driftlight
