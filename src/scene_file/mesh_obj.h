// SPDX-License-Identifier: Apache-2.0
/// Wavefront OBJ files.
#pragma once

#include <filesystem>
#include <vector>

#include "driftlight/scene.h"

namespace driftlight {

struct ObjFile {
  /// In object space, one for every group ("g" or "usemtl") with faces, as Mitsuba splits them.
  std::vector<TriangleMesh> meshes;
  /// The file asks for materials of an .mtl file, which is not read.
  bool names_materials = false;
};

struct ObjOptions {
  bool one_mesh = false;         ///< do not split by groups
  bool flip_tex_coords = false;  ///< v becomes 1 - v
};

/// Polygons become fans of triangles; equal vertices are merged. Throws InputError.
ObjFile read_obj(const std::filesystem::path& file, const ObjOptions& options);

}  // namespace driftlight
