// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the rules, one for each piece of the contribution.
///
/// Differentials of the pieces (d before a symbol), to be checked against bsdf_density.h,
/// bsdf_delta.h, geometry.h, emitter.h, sensor.h and walk.h line by line. The sweeps that chain
/// them are hand_derivatives.h.
#pragma once

#include "driftlight/hand_delta_rules.h"
#include "driftlight/hand_end_rules.h"
#include "driftlight/hand_surface_rules.h"
#include "driftlight/scene.h"

namespace driftlight {

/// All of them. A class, so that a test can replace single ones by wrong ones.
struct HandRules : HandDeltaRules, HandSurfaceRules, HandEndRules {};

}  // namespace driftlight
