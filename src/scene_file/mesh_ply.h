// SPDX-License-Identifier: Apache-2.0
/// Polygon files of Stanford (PLY).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mesh.h"

namespace driftlight {

/// Colours are as the file has them, of whole numbers the share of 255.
struct PlyFile : ColoredMesh {
  /// Properties of vertices and faces that are not used, such as "vertex confidence".
  std::vector<std::string> unused;
};

/// Reads positions, and where the file has them normals (nx, ny, nz), texture coordinates (u, v or
/// s, t or texture_u, texture_v) and colours (red, green, blue, or with diffuse_ before them, or r,
/// g, b) of the vertices; polygons become fans of triangles. Text and
/// binary files of both byte orders. Throws InputError that names the line, if it is one that is
/// wrong.
PlyFile read_ply(const std::filesystem::path& file);

}  // namespace driftlight
