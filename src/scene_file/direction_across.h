// SPDX-License-Identifier: Apache-2.0
/// The direction across another that Mitsuba takes where any would do.
#pragma once

#include "dialect.h"
#include "driftlight/scalar.h"

namespace driftlight {

/// A unit vector perpendicular to the unit vector `axis`.
Vec3d direction_across(const Vec3d& axis, Dialect dialect);

}  // namespace driftlight
