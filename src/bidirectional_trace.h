// SPDX-License-Identifier: Apache-2.0
/// Traces of paths with a light side.
#pragma once

#include "driftlight/phase_space.h"

namespace driftlight {

/// `trace` for a pattern with a light side.
TraceStatus trace_from_both_ends(const Scene& scene, const PathTopology& pattern,
                                 const PathCoordinates& coordinates, PathTopology& result);

}  // namespace driftlight
