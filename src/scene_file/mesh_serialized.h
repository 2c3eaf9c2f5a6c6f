// SPDX-License-Identifier: Apache-2.0
/// Mitsuba's own mesh files.
#pragma once

#include <filesystem>

#include "driftlight/scene.h"

namespace driftlight {

/// Mesh number `shape_index` (from 0) of a .serialized file of version 3 or 4, in object space.
/// Throws InputError.
TriangleMesh read_serialized(const std::filesystem::path& file, int shape_index);

}  // namespace driftlight
