// SPDX-License-Identifier: Apache-2.0
/// One path with all of its derivatives, as text.
#pragma once

#include <string>

#include "driftlight/gradient_check.h"
#include "driftlight/path_sampler.h"

namespace driftlight::cli {

/// Topology, coordinates, and each derivative by every method, in full precision.
std::string path_text(const Scene& scene, const PathSampler::Sample& path, const PathCheck& check);

}  // namespace driftlight::cli
