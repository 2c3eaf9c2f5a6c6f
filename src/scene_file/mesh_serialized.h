// SPDX-License-Identifier: Apache-2.0
/// Mitsuba's own mesh files.
#pragma once

#include <filesystem>

#include "mesh.h"

namespace driftlight {

/// Mesh number `shape_index` (from 0) of a .serialized file of version 3, 4 or 5. Colours are
/// linear. Throws InputError.
ColoredMesh read_serialized(const std::filesystem::path& file, int shape_index);

}  // namespace driftlight
