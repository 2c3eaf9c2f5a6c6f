// SPDX-License-Identifier: Apache-2.0
#include "shapes_xml.h"

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "bsdfs_xml.h"
#include "emitters_xml.h"
#include "mesh.h"
#include "mesh_obj.h"
#include "mesh_serialized.h"
#include "properties.h"

namespace driftlight {
namespace {

/// What a shape carries.
struct Attachments {
  std::shared_ptr<Surface> surface;  ///< none if the file gives no bsdf
  std::optional<Rgbd> radiance;
};

struct Quad {
  std::array<Vec3d, 4> corners;  ///< counter-clockwise about the normal
  std::array<Eigen::Vector2f, 4> uvs;
};

/// Appends the quad as two triangles whose winding follows the normal through mirrorings.
void append_quad(TriangleMesh& mesh, const Quad& quad, const Eigen::Affine3d& to_world, bool flip) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (std::size_t i = 0; i < 4; ++i) {
    mesh.positions.emplace_back((to_world * quad.corners[i]).cast<float>());
    mesh.uvs.push_back(quad.uvs[i]);
  }
  const bool reverse = (to_world.linear().determinant() < 0.0) != flip;
  const std::uint32_t second = reverse ? first + 3 : first + 1;
  const std::uint32_t last = reverse ? first + 1 : first + 3;
  mesh.triangles.push_back({first, second, first + 2});
  mesh.triangles.push_back({first + 2, last, first});
}

/// [-1, 1]^2 in the plane z = 0, with normal +z.
std::vector<Geometry> read_rectangle(Properties& properties, LoadContext&, const Attachments&) {
  const Quad quad{{Vec3d(-1, -1, 0), Vec3d(1, -1, 0), Vec3d(1, 1, 0), Vec3d(-1, 1, 0)},
                  {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}}};
  TriangleMesh mesh;
  append_quad(mesh, quad, properties.transform("toWorld"),
              properties.boolean("flipNormals", false));
  return {mesh};
}

/// [-1, 1]^3; each face has texture coordinates of its own, laid out as in Mitsuba.
std::vector<Geometry> read_cube(Properties& properties, LoadContext&, const Attachments&) {
  const std::array<Eigen::Vector2f, 4> uvs{{{0, 1}, {1, 1}, {1, 0}, {0, 0}}};
  const std::array<std::array<Vec3d, 4>, 6> faces{{
      {Vec3d(1, -1, -1), Vec3d(1, -1, 1), Vec3d(-1, -1, 1), Vec3d(-1, -1, -1)},
      {Vec3d(1, 1, -1), Vec3d(-1, 1, -1), Vec3d(-1, 1, 1), Vec3d(1, 1, 1)},
      {Vec3d(1, -1, -1), Vec3d(1, 1, -1), Vec3d(1, 1, 1), Vec3d(1, -1, 1)},
      {Vec3d(1, -1, 1), Vec3d(1, 1, 1), Vec3d(-1, 1, 1), Vec3d(-1, -1, 1)},
      {Vec3d(-1, -1, 1), Vec3d(-1, 1, 1), Vec3d(-1, 1, -1), Vec3d(-1, -1, -1)},
      {Vec3d(1, 1, -1), Vec3d(1, -1, -1), Vec3d(-1, -1, -1), Vec3d(-1, 1, -1)},
  }};
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  const bool flip = properties.boolean("flipNormals", false);
  TriangleMesh mesh;
  for (const auto& corners : faces) append_quad(mesh, {corners, uvs}, to_world, flip);
  return {mesh};
}

/// In Mitsuba 0.6 the scale of toWorld applies to the radius, but not to `center`.
std::vector<Geometry> read_sphere(Properties& properties, LoadContext&, const Attachments&) {
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  const double factor = std::cbrt(std::abs(to_world.linear().determinant()));
  const Eigen::Matrix3d rotation = to_world.linear() / factor;
  if (!(rotation * rotation.transpose()).isIdentity(1e-3))
    properties.fail("toWorld", "a sphere must be scaled evenly");
  Sphere sphere;
  const Vec3d center = properties.point("center").value_or(Vec3d::Zero());
  const bool scales_center = properties.dialect() == Dialect::Mitsuba3;
  sphere.center = (scales_center ? factor : 1.0) * rotation * center + to_world.translation();
  sphere.radius = factor * properties.positive("radius", 1.0);
  sphere.to_local = rotation.inverse();
  sphere.flip_normals = properties.boolean("flipNormals", false);
  return {sphere};
}

/// The unit disk in the plane z = 0, with normal +z.
std::vector<Geometry> read_disk(Properties& properties, LoadContext&,
                                const Attachments& attachments) {
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  const bool flip = properties.boolean("flipNormals", false);
  Disk disk{to_world.translation(), to_world.linear().col(0), to_world.linear().col(1)};
  if ((to_world.linear().determinant() < 0.0) == flip) return {disk};
  // Turning v turns the normal, and with it the texture coordinates, which should stay.
  if (attachments.surface && is_textured(*attachments.surface))
    properties.element().fail("a disk that is flipped or mirrored cannot carry a bitmap");
  disk.v = -disk.v;
  return {disk};
}

/// Properties that all meshes of files share, applied in Mitsuba's order.
void finish_mesh(Properties& properties, TriangleMesh& mesh) {
  const bool face_normals = properties.boolean("faceNormals", false);
  if (properties.has("maxSmoothAngle")) {
    if (face_normals)
      properties.fail("maxSmoothAngle", "give either 'faceNormals' or 'maxSmoothAngle'");
    split_at_creases(mesh, properties.non_negative("maxSmoothAngle", 0.0));
  }
  finish_normals(mesh, face_normals, properties.boolean("flipNormals", false));
}

std::vector<Geometry> read_obj_shape(Properties& properties, LoadContext&,
                                     const Attachments& attachments) {
  const std::string name = properties.required_text("filename");
  // Mitsuba 3 knows neither groups nor materials of obj files.
  const bool plain = properties.dialect() == Dialect::Mitsuba3;
  const ObjOptions options{.one_mesh = plain || properties.boolean("collapse", false),
                           .flip_tex_coords = properties.boolean("flipTexCoords", true)};
  const bool load_materials = !plain && properties.boolean("loadMaterials", true);
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  ObjFile file = with_location(properties.element(), [&] {
    return read_obj(properties.element().find_file(name), options);
  });
  if (file.names_materials && load_materials && !attachments.surface)
    properties.element().fail("'" + name +
                              "' names materials of an .mtl file, which is not read; "
                              "give the shape a bsdf, or set 'loadMaterials' to false");
  if (attachments.radiance && file.meshes.size() > 1)
    properties.element().fail("'" + name +
                              "' has several groups and cannot be an emitter; set "
                              "'collapse' to true");
  std::vector<Geometry> result;
  for (TriangleMesh& mesh : file.meshes) {
    transform_mesh(mesh, to_world);
    finish_mesh(properties, mesh);
    result.emplace_back(std::move(mesh));
  }
  return result;
}

std::vector<Geometry> read_serialized_shape(Properties& properties, LoadContext&,
                                            const Attachments&) {
  const std::string name = properties.required_text("filename");
  const int index = properties.integer("shapeIndex", 0);
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  TriangleMesh mesh = with_location(properties.element(), [&] {
    return read_serialized(properties.element().find_file(name), index);
  });
  transform_mesh(mesh, to_world);
  // Unlike for obj files, Mitsuba keeps the outside outside when this format is mirrored.
  if (to_world.linear().determinant() < 0.0) reverse_winding(mesh);
  finish_mesh(properties, mesh);
  return {std::move(mesh)};
}

using ShapeReader = std::vector<Geometry> (*)(Properties&, LoadContext&, const Attachments&);
constexpr std::array<std::pair<std::string_view, ShapeReader>, 6> kShapes{{
    {"rectangle", &read_rectangle},
    {"cube", &read_cube},
    {"sphere", &read_sphere},
    {"disk", &read_disk},
    {"obj", &read_obj_shape},
    {"serialized", &read_serialized_shape},
}};

Attachments read_attachments(Properties& properties, LoadContext& context) {
  Attachments result;
  for (const Element& element : properties.nested({"bsdf", "ref"})) {
    if (result.surface) element.fail("a second bsdf of the shape");
    const bool by_material = properties.type() == "obj" && element.find("name");
    if (by_material && element.dialect() == Dialect::Mitsuba06)
      element.fail("bsdfs for single materials of an obj file are not supported");
    result.surface = read_surface(element, context);
  }
  for (const Element& element : properties.nested({"emitter"})) {
    if (result.radiance) element.fail("a second emitter of the shape");
    result.radiance = read_area_radiance(element, context);
  }
  return result;
}

/// Mitsuba's default: emitters are black, all else is a grey diffuse.
std::shared_ptr<Surface> default_surface(const Attachments& attachments) {
  const Rgbd reflectance = Rgbd::Constant(attachments.radiance ? 0.0 : 0.5);
  return std::make_shared<Surface>(
      Surface{Diffuse{Texture(reflectance)}, std::nullopt, std::nullopt});
}

}  // namespace

void read_shape(const Element& element, LoadContext& context) {
  Properties properties(element);
  const ShapeReader reader = find_plugin(kShapes, properties);
  Attachments attachments = read_attachments(properties, context);
  std::vector<Geometry> geometries = reader(properties, context, attachments);
  properties.finish();

  if (!attachments.surface) attachments.surface = default_surface(attachments);
  const std::uint32_t material = material_index(*attachments.surface, context);
  std::optional<Rgbd> radiance = attachments.radiance;
  if (radiance && radiance->maxCoeff() == 0.0) radiance.reset();
  for (Geometry& geometry : geometries)
    with_location(element,
                  [&] { context.builder.add_shape(std::move(geometry), material, radiance); });
  context.objects.define(element, NamedObjects::Other{});
}

}  // namespace driftlight
