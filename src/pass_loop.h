// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "driftlight/render.h"
#include "stopwatch.h"

namespace driftlight {

/// Runs pass(0), pass(1), .. until the work or the time is used up, and fills all but the image.
template <class Pass>
PathResult run_passes(const RenderOptions& render, int samples_per_pixel, const Pass& pass) {
  const Stopwatch watch;
  PathResult result;
  std::uint64_t passes = 0;
  while (true) {
    const double elapsed = watch.seconds();
    const double fraction =
        render.time ? elapsed / *render.time : static_cast<double>(passes) / samples_per_pixel;
    if (render.progress) render.progress({std::min(fraction, 1.0), elapsed});
    if (fraction >= 1.0) break;
    result.stopped = render.stop != nullptr && render.stop->load();
    if (result.stopped) break;
    pass(passes++);
  }
  result.samples_per_pixel = static_cast<double>(passes);
  result.render_seconds = watch.seconds();
  return result;
}

}  // namespace driftlight
