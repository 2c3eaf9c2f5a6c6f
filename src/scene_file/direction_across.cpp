// SPDX-License-Identifier: Apache-2.0
#include "direction_across.h"

#include <Eigen/Geometry>
#include <cmath>

#include "driftlight/frame.h"

namespace driftlight {

Vec3d direction_across(const Vec3d& axis, Dialect dialect) {
  if (dialect == Dialect::Mitsuba3) return tangent_basis(axis).t;
  const bool leans_to_x = std::abs(axis.x()) > std::abs(axis.y());
  const Vec3d across =
      leans_to_x ? Vec3d(axis.z(), 0.0, -axis.x()) : Vec3d(0.0, axis.z(), -axis.y());
  return across.normalized().cross(axis);
}

}  // namespace driftlight
