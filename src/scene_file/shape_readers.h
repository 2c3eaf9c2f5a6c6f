// SPDX-License-Identifier: Apache-2.0
/// The readers of the shapes of scene files, one for each plugin.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "load_context.h"
#include "properties.h"

namespace driftlight {

/// What a shape carries.
struct Attachments {
  std::shared_ptr<Surface> surface;  ///< none if the file gives no bsdf
  /// Of the materials of an obj file.
  std::map<std::string, std::shared_ptr<Surface>> by_material;
  std::optional<Texture> radiance;
};

/// A shape in world space, in as many parts as it has. Those without a surface have that of the
/// shape.
using ShapeReader = std::vector<ShapePart> (*)(Properties&, LoadContext&, const Attachments&);

/// [-1, 1]^2 in the plane z = 0, with normal +z.
std::vector<ShapePart> read_rectangle(Properties&, LoadContext&, const Attachments&);
/// [-1, 1]^3; each face has texture coordinates of its own, laid out as in Mitsuba.
std::vector<ShapePart> read_cube(Properties&, LoadContext&, const Attachments&);
/// Of `radius` around `center`.
std::vector<ShapePart> read_sphere(Properties&, LoadContext&, const Attachments&);
/// The unit disk in the plane z = 0, with normal +z.
std::vector<ShapePart> read_disk(Properties&, LoadContext&, const Attachments&);
/// The side of the cylinder from `p0` to `p1`.
std::vector<ShapePart> read_cylinder(Properties&, LoadContext&, const Attachments&);

// Files of meshes.
std::vector<ShapePart> read_obj_shape(Properties&, LoadContext&, const Attachments&);
std::vector<ShapePart> read_ply_shape(Properties&, LoadContext&, const Attachments&);
std::vector<ShapePart> read_serialized_shape(Properties&, LoadContext&, const Attachments&);

}  // namespace driftlight
