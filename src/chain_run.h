// SPDX-License-Identifier: Apache-2.0
/// A render by Markov chains, from their start to the image.
#pragma once

#include <algorithm>
#include <optional>

#include "chain_loop.h"
#include "direct_pass.h"
#include "driftlight/error.h"
#include "driftlight/film.h"
#include "driftlight/options.h"
#include "driftlight/render.h"
#include "driftlight/scene.h"
#include "render_clock.h"

namespace driftlight {

/// Starts chains at paths of so many edges and more by start(min_edges, film), and runs them beside
/// a pass of direct light if that is apart. What start() returns has the chains as `all`, none of
/// them if such paths carry no light, bootstrap_mean(), flush() and statistics(). Then finish(it,
/// result) may add to the result. Throws InputError if no path carries light.
template <class Start, class Finish>
LangevinResult run_chains(const Scene& scene, DirectLight direct_light, int max_depth,
                          const RenderOptions& render, double mutations_per_pixel,
                          const Start& start, const Finish& finish) {
  const double pixels = scene.camera().pixel_count();
  RenderClock clock(render);
  const bool apart = direct_light == DirectLight::Apart;
  Film film(scene.camera().film_width, scene.camera().film_height, scene.camera().filter);
  auto chains = start(apart ? kDirectDepth + 1 : 1, film);
  const double bootstrap_seconds = clock.seconds();
  std::optional<DirectPass> direct;
  if (apart) {
    direct.emplace(scene, max_depth, render.seed);
    direct->pass();
    direct->set_share(chains.bootstrap_mean());
  }
  if (chains.all.empty() && !(direct && direct->mean() > 0.0))
    throw InputError("no path from the sensor to an emitter carries light");
  const auto develop = [&] {
    chains.flush();
    const LangevinStatistics so_far = chains.statistics();
    const double count = std::max(1.0, static_cast<double>(so_far.mutations));
    Image image = film.develop(so_far.b * pixels / count);
    if (direct) direct->add_to(image);
    return image;
  };
  const bool stopped =
      ChainLoop(chains.all, direct ? &*direct : nullptr, render, clock, mutations_per_pixel, pixels)
          .run(develop);

  LangevinResult result;
  result.image = develop();
  result.statistics = chains.statistics();
  result.statistics.stopped = stopped;
  result.statistics.bootstrap_seconds = bootstrap_seconds;
  result.statistics.render_seconds = clock.seconds() - bootstrap_seconds;
  if (direct) direct->report(result.statistics);
  finish(chains, result);
  return result;
}

}  // namespace driftlight
