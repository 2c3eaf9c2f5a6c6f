// SPDX-License-Identifier: Apache-2.0
#include "shape_extent.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace driftlight {
namespace {

/// Area, centroid and covariance of the uniform distribution on a surface.
struct ShapeMoments {
  double area = 0;
  Vec3d mean = Vec3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Of a set of triangles: sums of area, area p and area p p^T, of which the upper half.
struct TriangleSums {
  double area = 0;
  Vec3d first = Vec3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
};

/// A triangle has E[p p^T] = (s s^T + sum_i p_i p_i^T) / 12 with s = p_0 + p_1 + p_2.
void add_triangle(std::array<Vec3d, 3> p, const Vec3d& origin, TriangleSums& sums) {
  const double area = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
  for (Vec3d& corner : p) corner -= origin;
  const Vec3d s = p[0] + p[1] + p[2];
  sums.area += area;
  sums.first += area / 3.0 * s;
  // One half of it is enough, which takes half of the time, and large meshes show it.
  for (int row = 0; row < 3; ++row)
    for (int column = row; column < 3; ++column)
      sums.second(row, column) += area / 12.0 *
                                  (s[row] * s[column] + p[0][row] * p[0][column] +
                                   p[1][row] * p[1][column] + p[2][row] * p[2][column]);
}

/// In parallel, in an order of its own: the same to the last bit on any number of threads.
ShapeMoments moments(const TriangleMesh& mesh) {
  constexpr std::size_t kBlock = std::size_t{1} << 16U;
  const Vec3d origin = mesh.positions.front().cast<double>();
  const TriangleSums sums = tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), kBlock), TriangleSums{},
      [&](const auto& range, TriangleSums part) {
        for (std::size_t i = range.begin(); i != range.end(); ++i)
          add_triangle(corners(mesh, static_cast<std::uint32_t>(i)), origin, part);
        return part;
      },
      [](const TriangleSums& a, const TriangleSums& b) {
        return TriangleSums{a.area + b.area, a.first + b.first, a.second + b.second};
      });
  const Eigen::Matrix3d second = sums.second.selfadjointView<Eigen::Upper>();
  const Vec3d mean = sums.first / sums.area;
  return {sums.area, mean + origin, second / sums.area - mean * mean.transpose()};
}

ShapeMoments moments(const Sphere& sphere) {
  const double r2 = sphere.radius * sphere.radius;
  return {4.0 * kPi * r2, sphere.center, Eigen::Matrix3d::Identity() * (r2 / 3.0)};
}

ShapeMoments moments(const Disk& disk) {
  return {kPi * disk.u.cross(disk.v).norm(), disk.center,
          0.25 * (disk.u * disk.u.transpose() + disk.v * disk.v.transpose())};
}

ShapeMoments moments(const Cylinder& cylinder) {
  const Vec3d axis = cylinder.axis();
  const double across2 = 0.5 * cylinder.radius * cylinder.radius;
  const double along2 = cylinder.length * cylinder.length / 12.0;
  return {2.0 * kPi * cylinder.radius * cylinder.length,
          cylinder.base + 0.5 * cylinder.length * axis,
          across2 * Eigen::Matrix3d::Identity() + (along2 - across2) * axis * axis.transpose()};
}

}  // namespace

Eigen::AlignedBox3d bounds_of(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const auto& p : mesh.positions) box.extend(p.cast<double>());
  return box;
}
Eigen::AlignedBox3d bounds_of(const Sphere& sphere) {
  return {sphere.center.array() - sphere.radius, sphere.center.array() + sphere.radius};
}
Eigen::AlignedBox3d bounds_of(const Disk& disk) {
  const Vec3d half = (disk.u.array().square() + disk.v.array().square()).sqrt();
  return {disk.center - half, disk.center + half};
}
Eigen::AlignedBox3d bounds_of(const Cylinder& cylinder) {
  const Vec3d axis = cylinder.axis();
  const Vec3d half = cylinder.radius * (1.0 - axis.array().square()).max(0.0).sqrt();
  const Vec3d end = cylinder.base + cylinder.length * axis;
  return {cylinder.base.cwiseMin(end) - half, cylinder.base.cwiseMax(end) + half};
}

ShapeExtent extent_of(const Geometry& geometry) {
  const ShapeMoments m = std::visit([](const auto& shape) { return moments(shape); }, geometry);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(m.covariance);
  const Vec3d variance = axes.eigenvalues().cwiseMax(0.0);
  ShapeExtent extent;
  extent.area = m.area;
  extent.centroid = m.mean;
  extent.radius = std::sqrt(variance.sum());
  // Positions are floats: what is thinner than their rounding is flat.
  const double thinnest = 1e-10 * variance.maxCoeff();
  extent.planar = variance.x() <= thinnest;
  for (int i = 0; i < 3; ++i)
    if (variance[i] > thinnest)
      extent.whitening.row(i) = axes.eigenvectors().col(i).transpose() / std::sqrt(variance[i]);
  return extent;
}

}  // namespace driftlight
