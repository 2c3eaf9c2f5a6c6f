// SPDX-License-Identifier: Apache-2.0
/// What a few samples tell of a scene before it is rendered.
#pragma once

#include "brightness_map.h"
#include "driftlight/options.h"
#include "emission_guide.h"

namespace driftlight {

struct Pilot {
  BrightnessMap brightness;
  EmissionGuide guide;
  double sample_cost = 1;  ///< of a sample at the guide's rate, over one with a light subpath
};

/// Bidirectional samples in rounds of twice as many each time; each round is guided by the one
/// before, so that what is rare is found at last. Then some more choose the guide's rate
/// (light_rate.h). A function of its arguments, whatever the threads.
Pilot run_pilot(const Scene& scene, const LangevinOptions& options, std::uint64_t seed);

}  // namespace driftlight
