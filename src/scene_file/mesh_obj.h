// SPDX-License-Identifier: Apache-2.0
/// Wavefront OBJ files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "driftlight/scene.h"

namespace driftlight {

struct ObjFile {
  /// A group ("g" or "usemtl") with faces, as Mitsuba splits them, in object space.
  struct Part {
    TriangleMesh mesh;
    std::string material;  ///< empty if it names none
  };
  std::vector<Part> parts;
  std::string library;  ///< the last .mtl file that it names, if any
};

struct ObjOptions {
  bool one_mesh = false;         ///< do not split by groups
  bool flip_tex_coords = false;  ///< v becomes 1 - v
};

/// Polygons become fans of triangles; equal vertices are merged. Where only some faces of a part
/// have normals, those of the others are zero. Throws InputError that names the line, if it is one
/// that is wrong.
ObjFile read_obj(const std::filesystem::path& file, const ObjOptions& options);

}  // namespace driftlight
