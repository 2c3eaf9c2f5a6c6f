// SPDX-License-Identifier: Apache-2.0
#include "mesh.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_for_each.h>
#include <tbb/parallel_invoke.h>

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <boost/container_hash/hash.hpp>
#include <cmath>
#include <cstdint>
#include <numeric>

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

/// By blocks of triangles, which are added up in their order, each while those of the next are
/// found in parallel.
std::vector<Vec3d> normal_sums(const TriangleMesh& mesh) {
  constexpr std::size_t kBlock = std::size_t{1} << 13U;
  const std::size_t count = mesh.triangles.size();
  std::vector<Vec3d> sums(mesh.positions.size(), Vec3d::Zero());
  std::array<std::vector<std::array<Vec3d, 3>>, 2> normals;
  const auto find = [&](std::size_t block) {
    auto& found = normals[block % 2];
    const std::size_t first = block * kBlock;
    found.resize(first < count ? std::min(kBlock, count - first) : 0);
    tbb::parallel_for(std::size_t{0}, found.size(), [&](std::size_t i) {
      found[i] = weighted_normals(mesh, mesh.triangles[first + i]);
    });
  };
  const auto add = [&](std::size_t block) {
    const auto& found = normals[block % 2];
    for (std::size_t i = 0; i < found.size(); ++i)
      for (std::size_t corner = 0; corner < 3; ++corner)
        sums[mesh.triangles[block * kBlock + i][corner]] += found[i][corner];
  };
  find(0);
  for (std::size_t block = 0; block * kBlock < count; ++block)
    tbb::parallel_invoke([&] { add(block); }, [&] { find(block + 1); });
  return sums;
}

/// Vertices of no triangle with an area need some direction, too.
Eigen::Vector3f smooth_normal(const Vec3d& sum) {
  const Vec3d normal = sum.norm() > 0.0 ? Vec3d(sum.normalized()) : Vec3d(1, 0, 0);
  return normal.cast<float>();
}

void compute_smooth_normals(TriangleMesh& mesh) {
  const std::vector<Vec3d> sums = normal_sums(mesh);
  mesh.normals.resize(sums.size());
  tbb::parallel_for(std::size_t{0}, sums.size(),
                    [&](std::size_t i) { mesh.normals[i] = smooth_normal(sums[i]); });
}

/// Returns how many there were.
std::size_t fill_zero_normals(TriangleMesh& mesh) {
  const auto is_zero = [](const Eigen::Vector3f& n) { return n.isZero(0.0F); };
  const auto count = std::count_if(mesh.normals.begin(), mesh.normals.end(), is_zero);
  if (count == 0) return 0;
  const std::vector<Vec3d> sums = normal_sums(mesh);
  for (std::size_t i = 0; i < sums.size(); ++i)
    if (is_zero(mesh.normals[i])) mesh.normals[i] = smooth_normal(sums[i]);
  return static_cast<std::size_t>(count);
}

/// The bits of a vertex: position, normal and texture coordinates, the latter two zero where
/// absent. Minus zero is zero.
using VertexKey = std::array<std::uint64_t, 4>;

VertexKey vertex_key(const TriangleMesh& mesh, std::uint32_t vertex) {
  std::array<float, 8> values{};
  const auto put = [&](const auto& vector, std::size_t first) {
    std::copy_n(vector.data(), vector.size(), &values[first]);
  };
  put(mesh.positions[vertex], 0);
  if (!mesh.normals.empty()) put(mesh.normals[vertex], 3);
  if (!mesh.uvs.empty()) put(mesh.uvs[vertex], 6);
  for (float& value : values) value += 0.0F;
  return std::bit_cast<VertexKey>(values);
}

struct HashedVertex {
  std::uint32_t hash, index;
};

/// In the order of their indices, by buckets that fit into the cache.
std::vector<std::vector<HashedVertex>> hashed_vertices(const TriangleMesh& mesh) {
  constexpr std::size_t kBucketSize = 4096;
  const auto count = static_cast<std::uint32_t>(mesh.positions.size());
  std::vector<std::uint32_t> hashes(count);
  tbb::parallel_for(std::uint32_t{0}, count, [&](std::uint32_t i) {
    hashes[i] = static_cast<std::uint32_t>(boost::hash_value(vertex_key(mesh, i)));
  });
  std::vector<std::vector<HashedVertex>> buckets(count / kBucketSize + 1);
  for (auto& bucket : buckets) bucket.reserve(kBucketSize + kBucketSize / 8);
  for (std::uint32_t i = 0; i < count; ++i)
    buckets[hashes[i] % buckets.size()].push_back({hashes[i], i});
  return buckets;
}

/// The first of all vertices that equal each one.
std::vector<std::uint32_t> first_equals(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> result(mesh.positions.size());
  std::iota(result.begin(), result.end(), 0U);
  const auto buckets = hashed_vertices(mesh);
  tbb::parallel_for_each(buckets, [&](const std::vector<HashedVertex>& bucket) {
    // Distinct ones, each at its hash or the next free place.
    std::vector<const HashedVertex*> table(std::bit_ceil(2 * bucket.size() + 1));
    for (const HashedVertex& vertex : bucket) {
      const auto equals = [&](const HashedVertex& other) {
        return other.hash == vertex.hash &&
               vertex_key(mesh, other.index) == vertex_key(mesh, vertex.index);
      };
      std::size_t at = vertex.hash / buckets.size() % table.size();
      while (table[at] != nullptr && !equals(*table[at])) at = (at + 1) % table.size();
      if (table[at] == nullptr)
        table[at] = &vertex;
      else
        result[vertex.index] = table[at]->index;
    }
  });
  return result;
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

void merge_equal_vertices(TriangleMesh& mesh) {
  std::vector<std::uint32_t> merged = first_equals(mesh);
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < merged.size(); ++i) {
    if (merged[i] < i) {
      merged[i] = merged[merged[i]];
      continue;
    }
    mesh.positions[count] = mesh.positions[i];
    if (!mesh.normals.empty()) mesh.normals[count] = mesh.normals[i];
    if (!mesh.uvs.empty()) mesh.uvs[count] = mesh.uvs[i];
    merged[i] = count++;
  }
  mesh.positions.resize(count);
  if (!mesh.normals.empty()) mesh.normals.resize(count);
  if (!mesh.uvs.empty()) mesh.uvs.resize(count);
  if (count == merged.size()) return;
  tbb::parallel_for(std::size_t{0}, mesh.triangles.size(), [&](std::size_t t) {
    for (std::uint32_t& vertex : mesh.triangles[t]) vertex = merged[vertex];
  });
}

void transform_mesh(TriangleMesh& mesh, const Eigen::Affine3d& to_world) {
  tbb::parallel_for(std::size_t{0}, mesh.positions.size(), [&](std::size_t i) {
    mesh.positions[i] = (to_world * mesh.positions[i].cast<double>()).cast<float>();
  });
  const Eigen::Matrix3d normal_to_world = to_world.linear().inverse().transpose();
  tbb::parallel_for(std::size_t{0}, mesh.normals.size(), [&](std::size_t i) {
    mesh.normals[i] = (normal_to_world * mesh.normals[i].cast<double>()).normalized().cast<float>();
  });
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

std::size_t finish_normals(TriangleMesh& mesh, bool face_normals, bool flip) {
  if (face_normals) {
    mesh.normals.clear();
    if (flip) reverse_winding(mesh);
    return 0;
  }
  if (mesh.normals.empty()) compute_smooth_normals(mesh);
  const std::size_t filled = fill_zero_normals(mesh);
  if (flip)
    for (Eigen::Vector3f& n : mesh.normals) n = -n;
  return filled;
}

}  // namespace driftlight
