// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "driftlight/render.h"
#include "render_clock.h"

namespace driftlight {

/// Runs pass(0), pass(1), .. until the work or the time is used up, at least one of them unless it
/// is stopped; develop(n) is the image of n passes. Fills all but what is not finite. The seconds
/// are those of the passes; the time is that of the clock.
template <class Pass, class Develop>
PathResult run_passes(const RenderOptions& render, RenderClock& clock, int samples_per_pixel,
                      const Pass& pass, const Develop& develop) {
  const double start = clock.seconds();
  PathResult result;
  std::uint64_t passes = 0;
  while (true) {
    const double elapsed = clock.seconds();
    const double fraction =
        render.time ? elapsed / *render.time : static_cast<double>(passes) / samples_per_pixel;
    if (render.progress) render.progress({std::min(fraction, 1.0), elapsed});
    if (passes > 0) {
      const auto done = static_cast<double>(passes);
      clock.reach(fraction, done, [&] { return develop(done); });
      if (fraction >= 1.0) break;
    }
    result.stopped = render.stop != nullptr && render.stop->load();
    if (result.stopped) break;
    pass(passes++);
  }
  result.samples_per_pixel = static_cast<double>(passes);
  result.render_seconds = clock.seconds() - start;
  result.image = develop(result.samples_per_pixel);
  return result;
}

}  // namespace driftlight
