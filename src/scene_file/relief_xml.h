// SPDX-License-Identifier: Apache-2.0
/// Bump and normal maps of scene files.
#pragma once

#include "load_context.h"
#include "properties.h"

namespace driftlight {

/// <bsdf type="bumpmap">: a nested bsdf and a texture of heights.
Surface read_bump_map(Properties& properties, LoadContext& context);

/// <bsdf type="normalmap">: a nested bsdf and a texture of normals.
Surface read_normal_map(Properties& properties, LoadContext& context);

}  // namespace driftlight
