// SPDX-License-Identifier: Apache-2.0
/// The integrator `path`: the reference that the samplers are proven against.
#include <tbb/task_arena.h>

#include "driftlight/render.h"
#include "pass_loop.h"
#include "path_tracer.h"

namespace driftlight {
namespace {

PathResult run_path(const Scene& scene, const PathOptions& options, const RenderOptions& render,
                    int samples_per_pixel) {
  RenderClock clock(render);
  PixelSums sums(scene, options.max_depth, render.seed);
  PathResult result = run_passes(
      render, clock, samples_per_pixel, [&](std::uint64_t pass) { sums.pass(pass); },
      [&](double passes) { return sums.image(static_cast<std::uint64_t>(passes)); });
  result.non_finite = sums.non_finite();
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
