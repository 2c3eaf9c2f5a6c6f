// SPDX-License-Identifier: Apache-2.0
/// Polygon files of Stanford (PLY).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "driftlight/scene.h"

namespace driftlight {

struct PlyFile {
  TriangleMesh mesh;  ///< in object space
  /// Properties of vertices and faces that are not used, such as "vertex red".
  std::vector<std::string> unused;
};

/// Reads positions, and where the file has them normals (nx, ny, nz) and texture coordinates (u, v
/// or s, t or texture_u, texture_v) of the vertices; polygons become fans of triangles. Text and
/// binary files of both byte orders. Throws InputError.
PlyFile read_ply(const std::filesystem::path& file);

}  // namespace driftlight
