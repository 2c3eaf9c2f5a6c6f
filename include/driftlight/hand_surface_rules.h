// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the rules of surfaces, for a ray (x, v) of length t that meets one
/// with normal n.
///
///   dx' = (I - v n^T / n.v) (dx + t dv)                                                  (H14)
///   interpolated n = N / |N|, N = n_0 + b_1 e_1 + b_2 e_2:  dn = (I - n n^T) dN / |N|    (H15)
///   sphere           dn = dx' / R                                                        (H16)
///   relief           (H35), (H36) of hand_relief.h
///   P of the tangent dP = turn x dx' + spread dx'                                        (H44)
#pragma once

#include <array>
#include <cmath>

#include "driftlight/geometry.h"

namespace driftlight {

/// The differential of a surface about a point, for tangent dx: of the shading normal, and of uv.
struct SurfaceDifferential {
  /// dn = curvature (dx - straight (straight.dx)) + a1 (c1.dx) + a2 (c2.dx); the last two only if
  /// `interpolated`.
  double curvature = 0;
  Vec3d straight{0, 0, 0};  ///< unit direction in which a curved surface is not; zero if none
  bool interpolated = false;
  Vec3d a1, a2, c1, c2;
  /// du = u.dx, dv = v.dx; only if `textured`.
  bool textured = false;
  Vec3d u, v;

  Vec3d normal_adjoint(const Vec3d& n_bar) const {
    Vec3d x_bar = curvature * (n_bar - straight.dot(n_bar) * straight);
    if (interpolated) x_bar += a1.dot(n_bar) * c1 + a2.dot(n_bar) * c2;
    return x_bar;
  }
};

/// The rules (H14) to (H16), (H44).
struct HandSurfaceRules {
  /// n.v of (H14). On a sphere |n.v| = sqrt(R^2 - |l|^2) / R, l = o - c - b v, b = (o - c).v, as in
  /// geometry.h: near the silhouette n itself is too coarse. On a cylinder the same in the plane
  /// across its axis, times |v'|.
  static double hit_cosine(const Geometry& geometry, const Vec3d& origin, const Vec3d& v,
                           const Vec3d& n) {
    if (const auto* cylinder = std::get_if<Cylinder>(&geometry)) {
      const Vec3d o = cylinder->across(Vec3d(origin - cylinder->base));
      const Vec3d d = cylinder->across(v);
      const Vec3d l = along(o, -dot(o, d) / dot(d, d), d);
      const double root = std::sqrt((cylinder->radius * cylinder->radius - dot(l, l)) * dot(d, d));
      return std::copysign(root / cylinder->radius, n.dot(v));
    }
    const auto* sphere = std::get_if<Sphere>(&geometry);
    if (sphere == nullptr) return n.dot(v);
    const Vec3d oc = origin - sphere->center;
    const Vec3d l = along(oc, -dot(oc, v), v);
    const double root = std::sqrt(sphere->radius * sphere->radius - dot(l, l));
    return std::copysign(root / sphere->radius, n.dot(v));
  }

  /// The transpose of (I - v n^T / n.v) of (H14), at q; `cosine` is n.v.
  static Vec3d hit_adjoint(const Vec3d& v, const Vec3d& n, double cosine, const Vec3d& q) {
    return q - v.dot(q) / cosine * n;
  }

  /// (H44) transposed.
  static Vec3d tangent_adjoint(const TangentField& field, const Vec3d& p_bar) {
    return p_bar.cross(field.turn) + field.spread * p_bar;
  }

  /// (H15). `n_s` tells which side the normal was turned to.
  static SurfaceDifferential surface(const TriangleMesh& mesh, std::uint32_t primitive,
                                     const Vec3d& p, const Vec3d& n_s, bool textured) {
    SurfaceDifferential result;
    if (mesh.normals.empty() && !textured) return result;
    const auto& index = mesh.triangles[primitive];
    const std::array<Vec3d, 3> corner = corners(mesh, primitive);
    const Vec3d e1 = corner[1] - corner[0];
    const Vec3d e2 = corner[2] - corner[0];
    const Vec3d n = e1.cross(e2);
    const double inverse = 1.0 / n.squaredNorm();
    result.c1 = inverse * e2.cross(n);
    result.c2 = inverse * n.cross(e1);
    if (!mesh.normals.empty()) {
      const Vec3d n0 = mesh.normals[index[0]].cast<double>();
      const Vec3d edge1 = mesh.normals[index[1]].cast<double>() - n0;
      const Vec3d edge2 = mesh.normals[index[2]].cast<double>() - n0;
      const Vec3d step = p - corner[0];
      const Vec3d sum = n0 + result.c1.dot(step) * edge1 + result.c2.dot(step) * edge2;
      const double scale = 1.0 / sum.dot(n_s);  // +-1 / |N|
      result.interpolated = true;
      result.a1 = scale * (edge1 - n_s.dot(edge1) * n_s);
      result.a2 = scale * (edge2 - n_s.dot(edge2) * n_s);
    }
    if (textured) {
      result.textured = true;
      result.u = result.c1;
      result.v = result.c2;
      if (!mesh.uvs.empty()) {
        const Vec2d u0 = mesh.uvs[index[0]].cast<double>();
        const Vec2d u1 = mesh.uvs[index[1]].cast<double>() - u0;
        const Vec2d u2 = mesh.uvs[index[2]].cast<double>() - u0;
        result.u = u1.x() * result.c1 + u2.x() * result.c2;
        result.v = u1.y() * result.c1 + u2.y() * result.c2;
      }
    }
    return result;
  }

  /// (H16); u = atan2(Y, X) / (2 pi), v = acos(Z) / pi of the outward normal.
  static SurfaceDifferential surface(const Sphere& sphere, std::uint32_t, const Vec3d& p,
                                     const Vec3d& n_s, bool textured) {
    SurfaceDifferential result;
    const Vec3d out = (p - sphere.center) / sphere.radius;
    result.curvature = std::copysign(1.0 / sphere.radius, out.dot(n_s));
    if (textured) {
      const Vec3d x = sphere.to_local.row(0);
      const Vec3d y = sphere.to_local.row(1);
      const Vec3d z = sphere.to_local.row(2);
      const double cx = x.dot(out);
      const double cy = y.dot(out);
      const double cz = z.dot(out);
      result.textured = true;
      result.u = 0.5 * kInvPi / (sphere.radius * (cx * cx + cy * cy)) * (cx * y - cy * x);
      result.v = -kInvPi / (sphere.radius * std::sqrt(1.0 - cz * cz)) * z;
    }
    return result;
  }

  /// (H16) across the axis; u = atan2(Y, X) / (2 pi) of the outward normal, v = Z / length.
  static SurfaceDifferential surface(const Cylinder& cylinder, std::uint32_t, const Vec3d& p,
                                     const Vec3d& n_s, bool textured) {
    SurfaceDifferential result;
    const Vec3d out = cylinder.across(Vec3d(p - cylinder.base)) / cylinder.radius;
    result.curvature = std::copysign(1.0 / cylinder.radius, out.dot(n_s));
    result.straight = cylinder.axis();
    if (textured) {
      const Vec3d x = cylinder.to_local.row(0);
      const Vec3d y = cylinder.to_local.row(1);
      result.textured = true;
      result.u = 0.5 * kInvPi / cylinder.radius * (x.dot(out) * y - y.dot(out) * x);
      result.v = 1.0 / cylinder.length * cylinder.axis();
    }
    return result;
  }

  /// u = |(s, t)|, v = atan2(t, s) / (2 pi).
  static SurfaceDifferential surface(const Disk& disk, std::uint32_t, const Vec3d& p, const Vec3d&,
                                     bool textured) {
    SurfaceDifferential result;
    if (textured) {
      const Vec3d n = disk.u.cross(disk.v);
      const Vec3d cu = disk.v.cross(n) / n.squaredNorm();
      const Vec3d cv = n.cross(disk.u) / n.squaredNorm();
      const double s = cu.dot(p - disk.center);
      const double t = cv.dot(p - disk.center);
      const double r2 = s * s + t * t;
      result.textured = true;
      result.u = (s * cu + t * cv) / std::sqrt(r2);
      result.v = 0.5 * kInvPi / r2 * (s * cv - t * cu);
    }
    return result;
  }
};

}  // namespace driftlight
