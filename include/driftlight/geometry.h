// SPDX-License-Identifier: Apache-2.0
/// Shapes, and where rays meet them.
///
/// A hit is found once, with Embree, and is opaque; the interaction is computed from it for every
/// Scalar, so that derivatives see the exact geometry of the primitive that was hit.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <variant>
#include <vector>

#include "driftlight/surface_point.h"

namespace driftlight {

/// World-space triangles, counter-clockwise about the outer side. `normals` and `uvs` are empty or
/// as long as `positions`. With normals, they are interpolated for shading, and the geometric
/// normal takes their side. Without uvs, texture coordinates are the barycentric ones.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Eigen::Vector2f> uvs;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// uv = (phi / (2 pi), theta / pi) in the sphere's own frame, whose axes are the rows of
/// `to_local`. A hit's primitive is the root of the quadratic: 0 where the ray enters, 1 where it
/// leaves.
struct Sphere {
  Vec3d center{0, 0, 0};
  double radius = 1;
  Eigen::Matrix3d to_local = Eigen::Matrix3d::Identity();
  bool flip_normals = false;
};

/// The ellipse { center + s u + t v : s^2 + t^2 <= 1 } with normal along u x v.
/// uv = (r, phi / (2 pi)) in (s, t).
struct Disk {
  Vec3d center{0, 0, 0};
  Vec3d u{1, 0, 0};
  Vec3d v{0, 1, 0};
};

/// The side of a cylinder, open at both ends, with the normal outward. In its own frame, whose axes
/// are the rows of `to_local` and whose origin is the centre of one end, it is x^2 + y^2 =
/// radius^2, 0 <= z <= length. uv = (phi / (2 pi), z / length). Primitives as those of spheres.
struct Cylinder {
  Vec3d base{0, 0, 0};
  Eigen::Matrix3d to_local = Eigen::Matrix3d::Identity();
  double length = 1;
  double radius = 1;
  bool flip_normals = false;

  Vec3d axis() const { return to_local.row(2); }
  /// The part of a vector that is across the axis.
  template <Scalar T>
  Vec3<T> across(const Vec3<T>& d) const {
    return along(d, T(-dot(axis(), d)), constant<T>(axis()));
  }
};

using Geometry = std::variant<TriangleMesh, Sphere, Disk, Cylinder>;

/// Names a primitive of a shape of the scene.
struct Hit {
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  std::uint32_t shape = kNone;
  std::uint32_t primitive = 0;

  bool valid() const { return shape != kNone; }
  bool operator==(const Hit&) const = default;
};

/// A point on a surface, in world space.
template <Scalar T>
struct Interaction {
  Vec3<T> p;
  Vec3<T> n_g;  ///< unit geometric normal, on the side of n_s
  Vec3<T> n_s;  ///< unit shading normal
  Vec2<T> uv;   ///< texture coordinates; zero if not asked for
  /// Of `tangent_field`; zero if not asked for.
  Vec3<T> tangent = constant<T>(Vec3d(Vec3d::Zero()));

  SurfacePoint<T> surface() const { return {n_s, uv, tangent}; }
};

/// Corners of a triangle, in double.
inline std::array<Vec3d, 3> corners(const TriangleMesh& mesh, std::uint32_t triangle) {
  const auto& t = mesh.triangles[triangle];
  return {mesh.positions[t[0]].cast<double>(), mesh.positions[t[1]].cast<double>(),
          mesh.positions[t[2]].cast<double>()};
}

/// Unit geometric normal of a triangle, on the side of its vertex normals.
inline Vec3d geometric_normal(const TriangleMesh& mesh, std::uint32_t triangle) {
  const std::array<Vec3d, 3> p = corners(mesh, triangle);
  const Vec3d n = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
  if (mesh.normals.empty()) return n;
  Vec3d shading = Vec3d::Zero();
  for (const std::uint32_t i : mesh.triangles[triangle]) shading += mesh.normals[i].cast<double>();
  return n.dot(shading) < 0.0 ? Vec3d(-n) : n;
}

/// dp/du and dp/dv over a triangle, in world space.
struct SurfaceTangents {
  Vec3d u, v;
};

/// None where the mesh has no texture coordinates, or these do not span the triangle.
inline std::optional<SurfaceTangents> surface_tangents(const TriangleMesh& mesh,
                                                       std::uint32_t triangle) {
  if (mesh.uvs.empty()) return std::nullopt;
  const auto& index = mesh.triangles[triangle];
  const std::array<Vec3d, 3> p = corners(mesh, triangle);
  const Vec2d u0 = mesh.uvs[index[0]].cast<double>();
  const Vec2d u1 = mesh.uvs[index[1]].cast<double>() - u0;
  const Vec2d u2 = mesh.uvs[index[2]].cast<double>() - u0;
  const double area = u1.x() * u2.y() - u1.y() * u2.x();
  if (area == 0.0) return std::nullopt;
  const Vec3d e1 = (p[1] - p[0]) / area;
  const Vec3d e2 = (p[2] - p[0]) / area;
  return SurfaceTangents{u2.y() * e1 - u1.y() * e2, u1.x() * e2 - u2.x() * e1};
}

/// Vectors along dp/du at points p of a primitive, of any length: P = fixed + turn x p + spread p.
/// So on all shapes: one vector of a triangle, about the axis of spheres and cylinders, and from
/// the centre of disks. Where a triangle has no dp/du, its first edge.
struct TangentField {
  Vec3d fixed{0, 0, 0};
  Vec3d turn{0, 0, 0};
  double spread = 0;

  template <Scalar T>
  Vec3<T> at(const Vec3<T>& p) const {
    return {turn.y() * p.z() - turn.z() * p.y() + spread * p.x() + fixed.x(),
            turn.z() * p.x() - turn.x() * p.z() + spread * p.y() + fixed.y(),
            turn.x() * p.y() - turn.y() * p.x() + spread * p.z() + fixed.z()};
  }
};
inline TangentField tangent_field(const TriangleMesh& mesh, std::uint32_t triangle) {
  if (const auto tangents = surface_tangents(mesh, triangle)) return {tangents->u};
  const std::array<Vec3d, 3> p = corners(mesh, triangle);
  return {p[1] - p[0]};
}
inline TangentField tangent_field(const Sphere& sphere, std::uint32_t) {
  const Vec3d axis = sphere.to_local.row(2);
  return {sphere.center.cross(axis), axis};
}
inline TangentField tangent_field(const Cylinder& cylinder, std::uint32_t) {
  const Vec3d axis = cylinder.axis();
  return {cylinder.base.cross(axis), axis};
}
inline TangentField tangent_field(const Disk& disk, std::uint32_t) {
  return {-disk.center, Vec3d::Zero(), 1.0};
}
inline TangentField tangent_field(const Geometry& geometry, std::uint32_t primitive) {
  return std::visit([&](const auto& shape) { return tangent_field(shape, primitive); }, geometry);
}

/// Unit shading normal of a triangle at a point of its plane.
inline Vec3d shading_normal(const TriangleMesh& mesh, std::uint32_t triangle, const Vec3d& p) {
  if (mesh.normals.empty()) return geometric_normal(mesh, triangle);
  const std::array<Vec3d, 3> corner = corners(mesh, triangle);
  const Vec3d n = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  const Vec3d step = (p - corner[0]) / n.squaredNorm();
  const double b1 = n.dot(step.cross(corner[2] - corner[0]));
  const double b2 = n.dot((corner[1] - corner[0]).cross(step));
  const auto& index = mesh.triangles[triangle];
  const auto normal = [&](int i) -> Vec3d {
    return mesh.normals[index[static_cast<std::size_t>(i)]].cast<double>();
  };
  return ((1.0 - b1 - b2) * normal(0) + b1 * normal(1) + b2 * normal(2)).normalized();
}

// ---- Texture coordinates --------------------------------------------------------------------

/// At the barycentric coordinates b1, b2 of a triangle.
template <Scalar T>
Vec2<T> triangle_uv(const TriangleMesh& mesh, std::uint32_t triangle, const T& b1, const T& b2) {
  if (mesh.uvs.empty()) return {b1, b2};
  const auto& index = mesh.triangles[triangle];
  const Vec2d u0 = mesh.uvs[index[0]].cast<double>();
  const Vec2d u1 = mesh.uvs[index[1]].cast<double>() - u0;
  const Vec2d u2 = mesh.uvs[index[2]].cast<double>() - u0;
  return {b1 * u1.x() + b2 * u2.x() + u0.x(), b1 * u1.y() + b2 * u2.y() + u0.y()};
}

/// At a point of the triangle's plane.
template <Scalar T>
Vec2<T> triangle_uv(const TriangleMesh& mesh, std::uint32_t triangle, const Vec3<T>& p) {
  const std::array<Vec3d, 3> corner = corners(mesh, triangle);
  const Vec3d e1 = corner[1] - corner[0];
  const Vec3d e2 = corner[2] - corner[0];
  const Vec3d n = e1.cross(e2);
  const Vec3d c1 = e2.cross(n) / n.squaredNorm();
  const Vec3d c2 = n.cross(e1) / n.squaredNorm();
  return triangle_uv(mesh, triangle, T(dot(c1, p) - c1.dot(corner[0])),
                     T(dot(c2, p) - c2.dot(corner[0])));
}

/// phi / (2 pi) in [0, 1], from its cosine and sine or what is proportional to them.
template <Scalar T>
T azimuth_share(const T& cosine, const T& sine) {
  using std::atan2;
  const T phi = atan2(sine, cosine) * (0.5 * kInvPi);
  return value(phi) < 0.0 ? T(phi + 1.0) : phi;
}

/// Where the outward normal is n.
template <Scalar T>
Vec2<T> sphere_uv(const Sphere& sphere, const Vec3<T>& n) {
  using std::acos;
  const Vec3d x = sphere.to_local.row(0);
  const Vec3d y = sphere.to_local.row(1);
  const Vec3d z = sphere.to_local.row(2);
  return {azimuth_share(dot(x, n), dot(y, n)), acos(dot(z, n)) * kInvPi};
}

/// At a point of the disk's plane.
template <Scalar T>
Vec2<T> disk_uv(const Disk& disk, const Vec3<T>& p) {
  using std::sqrt;
  const Vec3d n = disk.u.cross(disk.v);
  const Vec3d cu = disk.v.cross(n) / n.squaredNorm();
  const Vec3d cv = n.cross(disk.u) / n.squaredNorm();
  const T s = dot(cu, p) - cu.dot(disk.center);
  const T q = dot(cv, p) - cv.dot(disk.center);
  return {sqrt(s * s + q * q), azimuth_share(s, q)};
}

namespace detail {

/// t = n.(p0 - o) / n.d meets the triangle's plane; barycentric b1, b2 by Cramer's rule:
/// b1 = n.((p - p0) x e2) / |n|^2,  b2 = n.(e1 x (p - p0)) / |n|^2  with n = e1 x e2.
template <Scalar T>
Interaction<T> interact_shape(const TriangleMesh& mesh, std::uint32_t primitive, const Ray<T>& ray,
                              bool want_uv) {
  const auto& index = mesh.triangles[primitive];
  const std::array<Vec3d, 3> corner = corners(mesh, primitive);
  const Vec3d e1 = corner[1] - corner[0];
  const Vec3d e2 = corner[2] - corner[0];
  const Vec3d n = e1.cross(e2);
  // Not a quotient: that of Jets is rounded in another way than that of doubles.
  const T t = (n.dot(corner[0]) - dot(n, ray.origin)) * (1.0 / dot(n, ray.direction));
  Interaction<T> at;
  at.p = along(ray.origin, t, ray.direction);
  const double n2 = n.squaredNorm();
  const Vec3d unit = n / std::sqrt(n2);
  at.n_g = constant<T>(unit);
  at.n_s = at.n_g;
  at.uv = constant<T>(Vec2d(0, 0));
  if (mesh.normals.empty() && !want_uv) return at;

  const Vec3d c1 = e2.cross(n) / n2;
  const Vec3d c2 = n.cross(e1) / n2;
  const T b1 = dot(c1, at.p) - c1.dot(corner[0]);
  const T b2 = dot(c2, at.p) - c2.dot(corner[0]);
  if (!mesh.normals.empty()) {
    const Vec3d n0 = mesh.normals[index[0]].cast<double>();
    const Vec3d edge1 = mesh.normals[index[1]].cast<double>() - n0;
    const Vec3d edge2 = mesh.normals[index[2]].cast<double>() - n0;
    at.n_s = normalized(Vec3<T>{b1 * edge1.x() + b2 * edge2.x() + n0.x(),
                                b1 * edge1.y() + b2 * edge2.y() + n0.y(),
                                b1 * edge1.z() + b2 * edge2.z() + n0.z()});
    if (unit.dot(value(at.n_s)) < 0.0) at.n_g = constant<T>(Vec3d(-unit));
  }
  if (want_uv) at.uv = triangle_uv(mesh, primitive, b1, b2);
  return at;
}

/// |o + t d - c|^2 = r^2:  t = -b -+ sqrt(r^2 - |l|^2),  b = (o - c).d,  l = o - c - b d, the
/// nearest point of the line to the centre: r^2 - |l|^2 keeps its digits where b^2 - (|o - c|^2 -
/// r^2) loses them (Haines et al., Ray Tracing Gems, ch. 7).
template <Scalar T>
Interaction<T> interact_shape(const Sphere& sphere, std::uint32_t primitive, const Ray<T>& ray,
                              bool want_uv) {
  using std::sqrt;
  const Vec3<T> oc = {ray.origin.x() - sphere.center.x(), ray.origin.y() - sphere.center.y(),
                      ray.origin.z() - sphere.center.z()};
  const T b = dot(oc, ray.direction);
  const Vec3<T> l = along(oc, T(-b), ray.direction);
  const T root = sqrt(sphere.radius * sphere.radius - dot(l, l));
  const T t = primitive == 0 ? T(-b - root) : T(root - b);
  const Vec3<T> n = normalized(along(oc, t, ray.direction));
  Interaction<T> at;
  const T radius = constant<T>(sphere.radius);
  at.p = along(constant<T>(sphere.center), radius, n);
  at.n_g = sphere.flip_normals ? Vec3<T>(-n) : n;
  at.n_s = at.n_g;
  at.uv = constant<T>(Vec2d(0, 0));
  if (want_uv) at.uv = sphere_uv(sphere, n);
  return at;
}

template <Scalar T>
Interaction<T> interact_shape(const Disk& disk, std::uint32_t /*primitive*/, const Ray<T>& ray,
                              bool want_uv) {
  const Vec3d n = disk.u.cross(disk.v);
  const T t = (n.dot(disk.center) - dot(n, ray.origin)) * (1.0 / dot(n, ray.direction));
  Interaction<T> at;
  at.p = along(ray.origin, t, ray.direction);
  at.n_g = constant<T>(Vec3d(n.normalized()));
  at.n_s = at.n_g;
  at.uv = constant<T>(Vec2d(0, 0));
  if (want_uv) at.uv = disk_uv(disk, at.p);
  return at;
}

/// As the sphere, in the plane across the axis: with o', d' the parts of o - c and d there,
/// t = -b -+ sqrt((r^2 - |l|^2) / |d'|^2),  b = o'.d' / |d'|^2,  l = o' - b d'.
template <Scalar T>
Interaction<T> interact_shape(const Cylinder& cylinder, std::uint32_t primitive, const Ray<T>& ray,
                              bool want_uv) {
  using std::sqrt;
  const Vec3<T> oc = {ray.origin.x() - cylinder.base.x(), ray.origin.y() - cylinder.base.y(),
                      ray.origin.z() - cylinder.base.z()};
  const Vec3<T> o = cylinder.across(oc);
  const Vec3<T> d = cylinder.across(ray.direction);
  const T inverse = 1.0 / dot(d, d);
  const T b = dot(o, d) * inverse;
  const Vec3<T> l = along(o, T(-b), d);
  const T root = sqrt((cylinder.radius * cylinder.radius - dot(l, l)) * inverse);
  const T t = primitive == 0 ? T(-b - root) : T(root - b);
  const Vec3<T> n = normalized(along(o, t, d));
  const Vec3d axis = cylinder.axis();
  const T z = dot(axis, oc) + t * dot(axis, ray.direction);
  const Vec3<T> on_axis = along(constant<T>(cylinder.base), z, constant<T>(axis));
  Interaction<T> at;
  at.p = along(on_axis, constant<T>(cylinder.radius), n);
  at.n_g = cylinder.flip_normals ? Vec3<T>(-n) : n;
  at.n_s = at.n_g;
  at.uv = constant<T>(Vec2d(0, 0));
  if (want_uv) {
    const Vec3d x = cylinder.to_local.row(0);
    const Vec3d y = cylinder.to_local.row(1);
    at.uv = {azimuth_share(dot(x, n), dot(y, n)), z * (1.0 / cylinder.length)};
  }
  return at;
}

}  // namespace detail

/// The point where the ray meets the primitive, whose surface is extended beyond its edges (planes
/// are not bounded). Non-finite if there is no such point.
template <Scalar T>
Interaction<T> interact(const Geometry& geometry, std::uint32_t primitive, const Ray<T>& ray,
                        bool want_uv) {
  return std::visit(
      [&](const auto& shape) { return detail::interact_shape(shape, primitive, ray, want_uv); },
      geometry);
}

}  // namespace driftlight
