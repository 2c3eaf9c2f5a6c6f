// SPDX-License-Identifier: Apache-2.0
/// Which coordinates a path has, by its sequence of lobes alone: a small step that keeps the lobes
/// keeps the chart, and each path has exactly one.
#pragma once

#include <optional>
#include <span>

#include "driftlight/path.h"
#include "driftlight/scene.h"

namespace driftlight {

/// The lobe of a vertex that goes on by a delta lobe, or by the BSDF's density.
Lobe lobe_of(const Bsdf& bsdf, bool delta);

/// Vertices on the light side of a path through these lobes, in order from the sensor, to the
/// emitter of this index; 0: it has the chart of PhaseSpace::Directions, if any. None if it has no
/// chart.
///
/// With PhaseSpace::Directions always 0, but none for a point, spot or directional emitter behind a
/// delta lobe. With PhaseSpace::Bidirectional it is 0 if the last lobe is wide: there the
/// connection to the emitter is free already, and a chart from both ends was measured to cost more
/// than it brings. Else the joining edge is, of the edges between ends that are both wide, the one
/// nearest to the middle of the path, and of two as near that nearer to the emitter; the sensor
/// counts as wide. If there is none, it is 0 where Directions has a chart, and else the edge
/// nearest to the middle between any two ends that are not delta. Always 0 for environments and for
/// emitters whose points have no chart (meshes that are not planar).
std::optional<int> light_side(PhaseSpace phase_space, const Scene& scene,
                              std::span<const Lobe> lobes, std::uint32_t index);

}  // namespace driftlight
