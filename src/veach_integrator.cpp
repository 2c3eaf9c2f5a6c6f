// SPDX-License-Identifier: Apache-2.0
/// Metropolis light transport by mutations of paths (Veach and Guibas 1997).
#include <tbb/task_arena.h>

#include <memory>
#include <optional>
#include <vector>

#include "chain_run.h"
#include "driftlight/bootstrap.h"
#include "driftlight/render.h"
#include "veach_chain.h"
#include "vertex_path.h"

namespace driftlight {
namespace {

/// The chains with what they are started from.
struct VeachChains {
  const MltOptions& options;
  PathMutation mutation;
  RunningMean bootstrap_weights;  ///< f / q
  std::vector<std::unique_ptr<VeachChain>> all;

  /// No chains if paths of min_edges and more carry no light.
  VeachChains(const Scene& scene, const MltOptions& with, const RenderOptions& render,
              int min_edges, Film& film)
      : options(with),
        mutation(scene, {min_edges, options.max_depth, options.step_min, options.step_max,
                         options.manifold_probability}) {
    if (min_edges > options.max_depth) return;
    PathSampler sampler(scene, options.max_depth, LargeSteps::Bdpt, min_edges,
                        PhaseSpace::Bidirectional);
    const Bootstrap bootstrap(sampler, scene, options.bootstrap, render.seed);
    bootstrap_weights = bootstrap.weights();
    if (!(bootstrap_weights.sum > 0.0)) return;
    for (const PathSampler::Sample& sample : bootstrap.resample(options.chains)) {
      VertexPath start = vertex_path(scene, sample);
      // But for rounding its light is that of the sample.
      if (!start.evaluate(scene)) continue;
      const auto index = static_cast<std::uint64_t>(all.size());
      all.push_back(std::make_unique<VeachChain>(mutation, options, film, start,
                                                 Rng(render.seed, Stream::Chain, index)));
    }
  }

  // The chains refer to it.
  VeachChains(const VeachChains&) = delete;
  VeachChains& operator=(const VeachChains&) = delete;

  double bootstrap_mean() const { return bootstrap_weights.mean(); }

  /// Deposits all that the chains have gathered.
  void flush() {
    for (const auto& chain : all) chain->flush();
  }
  /// Statistics in the order of the chains: the same for any number of threads.
  LangevinStatistics statistics() const {
    LangevinStatistics sum;
    for (const auto& chain : all) sum += chain->statistics();
    sum.large_step_probability = options.bidirectional_probability;
    sum.b = bootstrap_weights.mean();
    sum.b_error = all.empty() ? 0.0 : bootstrap_weights.error();
    return sum;
  }
};

}  // namespace

LangevinResult render_mlt(const Scene& scene, const MltOptions& options,
                          const RenderOptions& render, double mutations_per_pixel) {
  options.validate();
  require_pinhole(scene, "the integrator 'mlt'");
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  return arena.execute([&] {
    return run_chains(
        scene, options.direct, options.max_depth, render, mutations_per_pixel,
        [&](int min_edges, Film& film) {
          return VeachChains(scene, options, render, min_edges, film);
        },
        [](const auto&, LangevinResult&) {});
  });
}

}  // namespace driftlight
