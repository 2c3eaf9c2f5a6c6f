// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "driftlight/texture.h"

namespace driftlight {

/// EnvironmentMap::precision at the centres of the texels of a latitude-longitude map. Blurs are
/// taken in the plane of the map, which is right about the horizon and rough near the poles.
Bitmap environment_precision(const Bitmap& map);

}  // namespace driftlight
