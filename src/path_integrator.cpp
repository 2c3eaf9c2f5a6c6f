// SPDX-License-Identifier: Apache-2.0
/// The integrator `path`: the reference that the samplers are proven against.
#include <tbb/task_arena.h>

#include <algorithm>

#include "driftlight/render.h"
#include "path_tracer.h"
#include "stopwatch.h"

namespace driftlight {
namespace {

PathResult run_path(const Scene& scene, const PathOptions& options, const RenderOptions& render,
                    int samples_per_pixel) {
  PixelSums sums(scene, options.max_depth, render.seed);
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
    sums.pass(passes++);
  }
  result.image = sums.image(passes);
  result.samples_per_pixel = static_cast<double>(passes);
  result.non_finite = sums.non_finite();
  result.render_seconds = watch.seconds();
  return result;
}

}  // namespace

PathResult render_path(const Scene& scene, const PathOptions& options, const RenderOptions& render,
                       int samples_per_pixel) {
  options.validate();
  PathResult result;
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  arena.execute([&] { result = run_path(scene, options, render, samples_per_pixel); });
  return result;
}

}  // namespace driftlight
