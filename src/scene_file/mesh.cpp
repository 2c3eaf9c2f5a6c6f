// SPDX-License-Identifier: Apache-2.0
#include "mesh.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "driftlight/error.h"

namespace driftlight {
namespace {

Vec3d position(const TriangleMesh& mesh, const std::array<std::uint32_t, 3>& triangle,
               std::size_t corner) {
  return mesh.positions[triangle[corner]].cast<double>();
}

/// Unit normal by the winding; zero for triangles without area.
Vec3d face_normal(const TriangleMesh& mesh, const std::array<std::uint32_t, 3>& triangle) {
  const Vec3d a = position(mesh, triangle, 0);
  return (position(mesh, triangle, 1) - a).cross(position(mesh, triangle, 2) - a).normalized();
}

/// The unit normal times the angle at each corner; zero for triangles without area.
std::array<Vec3d, 3> weighted_normals(const TriangleMesh& mesh,
                                      const std::array<std::uint32_t, 3>& triangle) {
  const Vec3d p = position(mesh, triangle, 0);
  const Vec3d a = position(mesh, triangle, 1) - p;
  const Vec3d b = position(mesh, triangle, 2) - p;
  const Vec3d cross = a.cross(b);
  const double length = cross.norm();  // the product of two edges and the sine between them
  if (length == 0.0) return {Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};
  const double at_p = std::atan2(length, a.dot(b));
  const double at_a = std::atan2(length, a.dot(a - b));
  const Vec3d normal = cross / length;
  return {at_p * normal, at_a * normal, (kPi - at_p - at_a) * normal};
}

template <class Vector>
bool all_finite(const std::vector<Vector>& vectors) {
  return std::all_of(vectors.begin(), vectors.end(), [](const Vector& v) { return v.allFinite(); });
}

void compute_smooth_normals(TriangleMesh& mesh) {
  std::vector<Vec3d> sums(mesh.positions.size(), Vec3d::Zero());
  for (const auto& triangle : mesh.triangles) {
    const std::array<Vec3d, 3> normals = weighted_normals(mesh, triangle);
    for (std::size_t corner = 0; corner < 3; ++corner) sums[triangle[corner]] += normals[corner];
  }
  mesh.normals.clear();
  for (const Vec3d& sum : sums) {
    // Vertices of no triangle with an area need some direction, too.
    const Vec3d normal = sum.norm() > 0.0 ? Vec3d(sum.normalized()) : Vec3d(1, 0, 0);
    mesh.normals.emplace_back(normal.cast<float>());
  }
}

/// One corner of one triangle, ordered by what makes two vertices the same.
struct Corner {
  std::array<float, 5> key;
  std::size_t triangle;
  std::size_t corner;
};

std::vector<Corner> sorted_corners(const TriangleMesh& mesh) {
  std::vector<Corner> corners;
  corners.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t vertex = mesh.triangles[t][c];
      const Eigen::Vector3f& p = mesh.positions[vertex];
      const Eigen::Vector2f uv = mesh.uvs.empty() ? Eigen::Vector2f(0, 0) : mesh.uvs[vertex];
      corners.push_back({{p.x(), p.y(), p.z(), uv.x(), uv.y()}, t, c});
    }
  }
  std::stable_sort(corners.begin(), corners.end(),
                   [](const Corner& a, const Corner& b) { return a.key < b.key; });
  return corners;
}

}  // namespace

void check_mesh(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) throw InputError("the mesh has no triangles");
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle)
      if (vertex >= mesh.positions.size())
        throw InputError("a triangle refers to vertex " + std::to_string(vertex) +
                         ", but the mesh has only " + std::to_string(mesh.positions.size()));
  if (!all_finite(mesh.positions) || !all_finite(mesh.normals) || !all_finite(mesh.uvs))
    throw InputError("the mesh has a coordinate that is not finite");
}

void transform_mesh(TriangleMesh& mesh, const Eigen::Affine3d& to_world) {
  for (Eigen::Vector3f& p : mesh.positions) p = (to_world * p.cast<double>()).cast<float>();
  const Eigen::Matrix3d normal_to_world = to_world.linear().inverse().transpose();
  for (Eigen::Vector3f& n : mesh.normals)
    n = (normal_to_world * n.cast<double>()).normalized().cast<float>();
}

void reverse_winding(TriangleMesh& mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
}

void split_at_creases(TriangleMesh& mesh, double maximum_angle) {
  const double least_cosine = std::cos(maximum_angle * kPi / 180.0);
  std::vector<Vec3d> faces;
  for (const auto& triangle : mesh.triangles) faces.push_back(face_normal(mesh, triangle));

  TriangleMesh split;
  split.triangles = mesh.triangles;
  const std::vector<Corner> corners = sorted_corners(mesh);
  std::vector<bool> assigned(corners.size(), false);
  for (std::size_t first = 0; first < corners.size(); ++first) {
    if (assigned[first]) continue;
    const Vec3d& normal = faces[corners[first].triangle];
    const std::uint32_t old = mesh.triangles[corners[first].triangle][corners[first].corner];
    const auto vertex = static_cast<std::uint32_t>(split.positions.size());
    split.positions.push_back(mesh.positions[old]);
    if (!mesh.uvs.empty()) split.uvs.push_back(mesh.uvs[old]);
    for (std::size_t i = first; i < corners.size() && corners[i].key == corners[first].key; ++i) {
      const Vec3d& other = faces[corners[i].triangle];
      if (assigned[i] || !(other == normal || other.dot(normal) > least_cosine)) continue;
      assigned[i] = true;
      split.triangles[corners[i].triangle][corners[i].corner] = vertex;
    }
  }
  mesh = std::move(split);
}

void finish_normals(TriangleMesh& mesh, bool face_normals, bool flip) {
  if (face_normals) {
    mesh.normals.clear();
    if (flip) reverse_winding(mesh);
    return;
  }
  if (mesh.normals.empty()) compute_smooth_normals(mesh);
  if (flip)
    for (Eigen::Vector3f& n : mesh.normals) n = -n;
}

}  // namespace driftlight
