// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bidirectional_tracer.h"
#include "driftlight/path_sampler.h"
#include "vertex_path.h"

namespace driftlight {

/// What bidirectional path tracing has found, with coordinates of the phase space; none if it has
/// no chart there. Its last vertices are traced anew, as every state of a chain is.
std::optional<PathSampler::Sample> state_of(const Scene& scene, const FoundPath& found,
                                            PhaseSpace phase_space = PhaseSpace::Directions);

/// The same of an evaluated path of a pinhole.
std::optional<PathSampler::Sample> state_of(const Scene& scene, const VertexPath& path,
                                            PhaseSpace phase_space = PhaseSpace::Directions);

}  // namespace driftlight
