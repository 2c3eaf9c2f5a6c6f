// SPDX-License-Identifier: Apache-2.0
/// The bidirectional path tracer. Like the path tracer it is a reference: it shares tracing and
/// BSDFs with the samplers, but neither the contribution template nor any of their densities.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include "bidirectional_tracer.h"
#include "driftlight/render.h"
#include "pass_loop.h"
#include "sample_film.h"

namespace driftlight {
namespace {

/// Index of strategy (s, t) among those of all lengths n = s + t - 1: n = 1 has (0, 2) alone, a
/// length n > 1 has (n, 1) .. (0, n + 1).
int strategy_index(int s, int t) {
  const int n = s + t - 1;
  return n * (n + 1) / 2 + t - 3;
}

std::vector<std::string> strategy_names(int max_depth) {
  std::vector<std::string> names{"s0t2"};
  for (int n = 2; n <= max_depth; ++n)
    for (int t = 1; t <= n + 1; ++t) names.push_back(fmt::format("s{}t{}", n + 1 - t, t));
  return names;
}

/// Sorts what the tracer finds by strategy.
class StrategySink {
 public:
  explicit StrategySink(SampleFilm::Sink& film) : film_(film) {}

  void add(const Rgbd& value, const FoundPath& path) {
    film_.add(value, strategy_index(path.s, path.t));
  }
  void splat(const Vec2d& film, const Rgbd& value, const FoundPath& path) {
    film_.splat(film, value, strategy_index(path.s, path.t));
  }

 private:
  SampleFilm::Sink& film_;
};

class BdptSampler {
 public:
  BdptSampler(const Scene& scene, const EmissionGuide& guide, const BdptOptions& options)
      : tracer_(scene, guide, options.heuristic, options.max_depth) {}

  void sample(const Vec2d& film, Rng& rng, SampleFilm::Sink& film_sink) {
    StrategySink sink(film_sink);
    tracer_.sample(film, rng, sink);
  }

 private:
  BidirectionalTracer tracer_;
};

}  // namespace

PathResult render_bdpt(const Scene& scene, const BdptOptions& options, const RenderOptions& render,
                       int samples_per_pixel) {
  options.validate();
  RenderClock clock(render);
  const EmissionGuide unguided(scene);
  const BdptSampler sampler(scene, unguided, options);
  std::vector<std::string> names;
  if (render.strategies != nullptr) names = strategy_names(options.max_depth);
  SampleFilm film(scene.camera(), render.seed, static_cast<int>(names.size()));
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  PathResult result = arena.execute([&] {
    return run_passes(
        render, clock, samples_per_pixel, [&](std::uint64_t index) { film.pass(index, sampler); },
        [&](double passes) { return film.image(passes); });
  });
  result.non_finite = film.non_finite();
  if (render.strategies != nullptr)
    *render.strategies = film.layers(names, result.samples_per_pixel);
  return result;
}

}  // namespace driftlight
