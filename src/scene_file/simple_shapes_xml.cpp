// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <array>
#include <cmath>

#include "bsdfs_xml.h"
#include "direction_across.h"
#include "shape_readers.h"
#include "transform_geometry.h"

namespace driftlight {
namespace {

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

}  // namespace

std::vector<ShapePart> read_rectangle(Properties& properties, LoadContext&, const Attachments&) {
  const Quad quad{{Vec3d(-1, -1, 0), Vec3d(1, -1, 0), Vec3d(1, 1, 0), Vec3d(-1, 1, 0)},
                  {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}}};
  TriangleMesh mesh;
  append_quad(mesh, quad, properties.transform("toWorld"),
              properties.boolean("flipNormals", false));
  // In Mitsuba 3 it is a mesh.
  if (properties.dialect() == Dialect::Mitsuba3) properties.ignore({"faceNormals"});
  return {{mesh}};
}

std::vector<ShapePart> read_cube(Properties& properties, LoadContext&, const Attachments&) {
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
  // Its normals are those of its faces anyway. Without them nothing keeps a mirrored cube of
  // Mitsuba 0.6 from turning inside out.
  const bool face_normals = properties.boolean("faceNormals", false);
  const bool turns = face_normals && properties.dialect() != Dialect::Mitsuba3 &&
                     to_world.linear().determinant() < 0.0;
  const bool flip = properties.boolean("flipNormals", false) != turns;
  TriangleMesh mesh;
  for (const auto& corners : faces) append_quad(mesh, {corners, uvs}, to_world, flip);
  return {{mesh}};
}

std::vector<ShapePart> read_sphere(Properties& properties, LoadContext&, const Attachments&) {
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  const double factor = std::cbrt(std::abs(to_world.linear().determinant()));
  const Eigen::Matrix3d rotation = to_world.linear() / factor;
  if (!(rotation * rotation.transpose()).isIdentity(1e-3))
    properties.fail("toWorld", "a sphere must be scaled evenly");
  Sphere sphere;
  const Vec3d center = properties.point("center").value_or(Vec3d::Zero());
  // In Mitsuba 0.6 the scale of toWorld applies to the radius, but not to the center.
  const bool scales_center = properties.dialect() == Dialect::Mitsuba3;
  sphere.center = (scales_center ? factor : 1.0) * rotation * center + to_world.translation();
  sphere.radius = factor * properties.positive("radius", 1.0);
  sphere.to_local = rotation.inverse();
  sphere.flip_normals = properties.boolean("flipNormals", false);
  return {{sphere}};
}

std::vector<ShapePart> read_disk(Properties& properties, LoadContext&,
                                 const Attachments& attachments) {
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  const bool flip = properties.boolean("flipNormals", false);
  Disk disk{to_world.translation(), to_world.linear().col(0), to_world.linear().col(1)};
  if ((to_world.linear().determinant() < 0.0) == flip) return {{disk}};
  // Turning v turns the normal, and with it the texture coordinates, which should stay.
  if (attachments.surface && is_textured(*attachments.surface))
    properties.element().fail("a disk that is flipped or mirrored cannot carry a texture");
  disk.v = -disk.v;
  return {{disk}};
}

std::vector<ShapePart> read_cylinder(Properties& properties, LoadContext&, const Attachments&) {
  const Vec3d p0 = properties.point("p0").value_or(Vec3d(0, 0, 0));
  const Vec3d p1 = properties.point("p1").value_or(Vec3d(0, 0, 1));
  if (!((p1 - p0).norm() > 0.0)) properties.fail("p1", "must not be 'p0'");
  const Vec3d axis = (p1 - p0).normalized();
  // Where Mitsuba begins to count the angle.
  const Vec3d x = direction_across(axis, properties.dialect());
  Cylinder cylinder;
  cylinder.base = p0;
  cylinder.length = (p1 - p0).norm();
  cylinder.radius = properties.positive("radius", 1.0);
  cylinder.to_local << x.transpose(), axis.cross(x).transpose(), axis.transpose();
  cylinder.flip_normals = properties.boolean("flipNormals", false);
  const auto moved = transformed(cylinder, properties.transform("toWorld"));
  if (!moved)
    properties.fail("toWorld", "a cylinder must be scaled evenly across its axis, and not sheared");
  return {{*moved}};
}

}  // namespace driftlight
