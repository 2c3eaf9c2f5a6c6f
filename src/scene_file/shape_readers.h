// SPDX-License-Identifier: Apache-2.0
/// The readers of the shapes of scene files, one for each plugin.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "load_context.h"
#include "properties.h"

namespace driftlight {

/// What a shape carries.
struct Attachments {
  std::shared_ptr<Surface> surface;  ///< none if the file gives no bsdf
  std::optional<Rgbd> radiance;
};

/// The geometry of a shape in world space, in as many parts as it has.
using ShapeReader = std::vector<Geometry> (*)(Properties&, LoadContext&, const Attachments&);

/// [-1, 1]^2 in the plane z = 0, with normal +z.
std::vector<Geometry> read_rectangle(Properties&, LoadContext&, const Attachments&);
/// [-1, 1]^3; each face has texture coordinates of its own, laid out as in Mitsuba.
std::vector<Geometry> read_cube(Properties&, LoadContext&, const Attachments&);
/// Of `radius` around `center`.
std::vector<Geometry> read_sphere(Properties&, LoadContext&, const Attachments&);
/// The unit disk in the plane z = 0, with normal +z.
std::vector<Geometry> read_disk(Properties&, LoadContext&, const Attachments&);
/// The side of the cylinder from `p0` to `p1`.
std::vector<Geometry> read_cylinder(Properties&, LoadContext&, const Attachments&);

// Files of meshes.
std::vector<Geometry> read_obj_shape(Properties&, LoadContext&, const Attachments&);
std::vector<Geometry> read_ply_shape(Properties&, LoadContext&, const Attachments&);
std::vector<Geometry> read_serialized_shape(Properties&, LoadContext&, const Attachments&);

}  // namespace driftlight
