// SPDX-License-Identifier: Apache-2.0
#include "transform_geometry.h"

#include <Eigen/LU>
#include <cmath>

#include "mesh.h"

namespace driftlight {
namespace {

/// How far from exact the matrices of scene files may be.
constexpr double kTolerance = 1e-3;

}  // namespace

std::optional<Sphere> transformed(const Sphere& sphere, const Eigen::Affine3d& map) {
  const double factor = std::cbrt(std::abs(map.linear().determinant()));
  const Eigen::Matrix3d rotation = map.linear() / factor;
  if (!(rotation * rotation.transpose()).isIdentity(kTolerance)) return std::nullopt;
  Sphere result = sphere;
  result.center = map * sphere.center;
  result.radius = factor * sphere.radius;
  result.to_local = sphere.to_local * rotation.inverse();
  return result;
}

std::optional<Cylinder> transformed(const Cylinder& cylinder, const Eigen::Affine3d& map) {
  const Vec3d along = map.linear() * cylinder.axis();
  const Vec3d x = map.linear() * Vec3d(cylinder.to_local.row(0));
  const Vec3d y = map.linear() * Vec3d(cylinder.to_local.row(1));
  const Vec3d axis = along.normalized();
  const double factor = x.norm();
  const auto is_small = [&](double length) { return std::abs(length) < kTolerance * factor; };
  if (!is_small(axis.dot(x)) || !is_small(axis.dot(y)) || !is_small(x.dot(y) / factor) ||
      !is_small(y.norm() - factor))
    return std::nullopt;
  Cylinder result = cylinder;
  result.base = map * cylinder.base;
  result.length = along.norm() * cylinder.length;
  result.radius = factor * cylinder.radius;
  const Vec3d unit_x = (x - axis.dot(x) * axis).normalized();
  const Vec3d unit_y = axis.cross(unit_x);
  result.to_local.row(0) = unit_x;
  result.to_local.row(1) = unit_y.dot(y) < 0.0 ? Vec3d(-unit_y) : unit_y;
  result.to_local.row(2) = axis;
  return result;
}

std::optional<Disk> transformed(const Disk& disk, const Eigen::Affine3d& map) {
  const double side = map.linear().determinant() < 0.0 ? -1.0 : 1.0;
  return Disk{map * disk.center, map.linear() * disk.u, side * (map.linear() * disk.v)};
}

std::optional<TriangleMesh> transformed(const TriangleMesh& mesh, const Eigen::Affine3d& map) {
  TriangleMesh result = mesh;
  transform_mesh(result, map);
  if (map.linear().determinant() < 0.0) reverse_winding(result);
  return result;
}

}  // namespace driftlight
