// SPDX-License-Identifier: Apache-2.0
/// Shapes under affine maps. The outside stays outside, also where the map mirrors.
#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "driftlight/geometry.h"

namespace driftlight {

/// Nothing where the shape is no longer of its kind: a sphere that is not scaled evenly, or a
/// cylinder that is sheared or not scaled evenly across its axis. A mirrored disk keeps its side,
/// so that its texture coordinates run the other way round.
std::optional<Sphere> transformed(const Sphere& sphere, const Eigen::Affine3d& map);
std::optional<Cylinder> transformed(const Cylinder& cylinder, const Eigen::Affine3d& map);
std::optional<Disk> transformed(const Disk& disk, const Eigen::Affine3d& map);
std::optional<TriangleMesh> transformed(const TriangleMesh& mesh, const Eigen::Affine3d& map);

}  // namespace driftlight
