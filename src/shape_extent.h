// SPDX-License-Identifier: Apache-2.0
/// Where shapes are and how large.
#pragma once

#include <Eigen/Geometry>

#include "driftlight/scene.h"

namespace driftlight {

Eigen::AlignedBox3d bounds_of(const TriangleMesh& mesh);
Eigen::AlignedBox3d bounds_of(const Sphere& sphere);
Eigen::AlignedBox3d bounds_of(const Disk& disk);
Eigen::AlignedBox3d bounds_of(const Cylinder& cylinder);

ShapeExtent extent_of(const Geometry& geometry);

}  // namespace driftlight
