// SPDX-License-Identifier: Apache-2.0
/// Second derivatives of the potential of a path.
#pragma once

#include "driftlight/phase_space.h"

namespace driftlight {

/// The Hessian of U = -log target over the tangent coordinates of the chart at `delta`, by Jets of
/// Jets, a block of 4 x 4 coordinates in each walk. (d x d)
Matrix hessian(const Scene& scene, const PathTopology& topology, const Chart& chart,
               const Vector& delta);

}  // namespace driftlight
