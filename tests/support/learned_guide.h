// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pilot.h"
#include "support/test_scenes.h"

namespace driftlight::test {

/// The guide that a small pilot of the scene learns.
inline EmissionGuide learned_guide(const TestScene& test) {
  LangevinOptions options;
  options.max_depth = test.max_depth;
  options.redistribution.pilot = 8192;
  options.redistribution.light_subpaths = 1;
  return run_pilot(test.scene, options, 1).guide;
}

}  // namespace driftlight::test
