// SPDX-License-Identifier: Apache-2.0
/// What a scene asks of a machine and of the integrators.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "driftlight/scene.h"

namespace driftlight::cli {

/// Bytes of meshes and bitmaps, without Embree's trees.
std::size_t memory_of(const Scene& scene);

/// A line for each kind of light that some integrators miss, or for why they cannot render the
/// scene; none if all render all of it.
std::vector<std::string> limits_of(const Scene& scene);

}  // namespace driftlight::cli
