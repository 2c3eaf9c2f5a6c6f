// SPDX-License-Identifier: Apache-2.0
/// What all meshes of scene files go through, whatever their format.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "driftlight/scene.h"

namespace driftlight {

/// A mesh as files have it, in object space.
struct ColoredMesh {
  TriangleMesh mesh;
  std::vector<Eigen::Vector3f> colors;  ///< of the vertices; empty, or one for each
  bool face_normals = false;            ///< its faces are to look flat
};

/// Throws InputError if the mesh is empty, or has an index out of range or a number that is not
/// finite.
void check_mesh(const TriangleMesh& mesh);

/// Vertices of equal position, normal and texture coordinates become one, in the order in which
/// they first occur. All numbers must be finite.
void merge_equal_vertices(TriangleMesh& mesh);

/// Brings positions and normals from object to world space.
void transform_mesh(TriangleMesh& mesh, const Eigen::Affine3d& to_world);

/// Reverses the order of the vertices of every triangle.
void reverse_winding(TriangleMesh& mesh);

/// Discards the normals, merges vertices of equal position and texture coordinates, and splits them
/// again where the normals of neighbouring triangles differ by more than the angle (degrees).
void split_at_creases(TriangleMesh& mesh, double maximum_angle);

/// Mitsuba's rules for normals. `face_normals` discards them; otherwise a mesh without any gets
/// smooth ones: means of the normals of the triangles around a vertex, weighted by their angles at
/// it (Thuermer and Wuethrich 1998). `flip` turns all to the other side. Beyond Mitsuba's rules, a
/// normal that is zero becomes the smooth one. Returns how many those were.
std::size_t finish_normals(TriangleMesh& mesh, bool face_normals, bool flip);

}  // namespace driftlight
