// SPDX-License-Identifier: Apache-2.0
#include "driftlight/render.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "chain_run.h"
#include "driftlight/bootstrap.h"
#include "driftlight/chain.h"
#include "driftlight/error.h"
#include "driftlight/film.h"
#include "redistribution.h"
#include "scale_tuning.h"

namespace driftlight {

Rejections& Rejections::operator+=(const Rejections& other) {
  missed += other.missed;
  other_lobe += other.other_lobe;
  occluded += other.occluded;
  non_finite += other.non_finite;
  hastings += other.hastings;
  return *this;
}

KernelStatistics& KernelStatistics::operator+=(const KernelStatistics& other) {
  proposed += other.proposed;
  accepted += other.accepted;
  return *this;
}

LevelFigures& LevelFigures::operator+=(const LevelFigures& other) {
  particles += other.particles;
  died += other.died;
  ratio += other.ratio;
  squared_ratio += other.squared_ratio;
  steps += other.steps;
  second_steps += other.second_steps;
  rejections += other.rejections;
  return *this;
}

LangevinStatistics& LangevinStatistics::operator+=(const LangevinStatistics& other) {
  large_step += other.large_step;
  small_step += other.small_step;
  second_step += other.second_step;
  rejections += other.rejections;
  for (std::size_t n = 0; n < path_length.size(); ++n) path_length[n] += other.path_length[n];
  mutations += other.mutations;
  return *this;
}

namespace {

/// The chains with what they are started from.
struct Chains {
  LangevinOptions options;
  std::optional<PathSampler> sampler;
  RunningMean bootstrap_weights;  ///< f / q
  std::vector<std::unique_ptr<Chain>> all;
  std::vector<GradientProbe> probes;  ///< of each, if gradients are checked

  /// No chains if paths of min_depth edges and more carry no light.
  Chains(const Scene& scene, const LangevinOptions& given, const RenderOptions& render,
         int min_depth, Film& film)
      : options(given) {
    if (min_depth > options.max_depth) return;
    sampler.emplace(scene, options.max_depth, options.large_steps, min_depth, options.phase_space);
    const Bootstrap bootstrap(*sampler, scene, options.bootstrap, render.seed);
    bootstrap_weights = bootstrap.weights();
    if (!(bootstrap_weights.sum > 0.0)) return;
    if (!options.large_step_probability)
      options.large_step_probability = std::clamp(bootstrap.effective_fraction(), 0.1, 0.9);
    const std::vector<PathSampler::Sample> starts = bootstrap.resample(options.chains);
    const auto start_all = [&](Film& on, std::uint64_t seed, StepLayers* layers) {
      std::vector<std::unique_ptr<Chain>> chains;
      chains.reserve(starts.size());
      for (const PathSampler::Sample& start : starts)
        chains.push_back(std::make_unique<Chain>(
            scene, *sampler, options, on, start,
            Rng(seed, Stream::Chain, static_cast<std::uint64_t>(chains.size())), layers));
      return chains;
    };
    if (options.target_acceptance > 0.0) {
      Film unseen(scene.camera().film_width, scene.camera().film_height, scene.camera().filter);
      tune_scale(options.target_acceptance, start_all(unseen, ~render.seed, nullptr),
                 options.kernel.scale);
    }
    all = start_all(film, render.seed, render.layers);
    if (!render.check_gradients) return;
    for (std::uint64_t i = 0; i < all.size(); ++i)
      probes.emplace_back(scene, options.kernel, render.seed, i);
    for (std::size_t i = 0; i < all.size(); ++i) all[i]->observe(probes[i]);
  }

  double bootstrap_mean() const { return bootstrap_weights.mean(); }

  GradientTable gradient_check() const {
    GradientTable table;
    for (const GradientProbe& probe : probes)
      for (const CheckedPath& path : probe.paths()) table.add(path);
    return table;
  }

  // The chains refer to it.
  Chains(const Chains&) = delete;
  Chains& operator=(const Chains&) = delete;

  /// Deposits all that the chains have gathered.
  void flush() {
    for (const auto& chain : all) chain->flush();
  }
  /// Statistics in the order of the chains: the same for any number of threads.
  LangevinStatistics statistics() const {
    LangevinStatistics sum;
    RunningMean weights = bootstrap_weights;
    for (const auto& chain : all) {
      sum += chain->statistics();
      weights += chain->weights();
    }
    sum.large_step_probability = options.large_step_probability.value_or(0.0);
    sum.b = weights.mean();
    sum.b_error = all.empty() ? 0.0 : weights.error();
    return sum;
  }
};

LangevinResult run_langevin(const Scene& scene, const LangevinOptions& options,
                            const RenderOptions& render, double mutations_per_pixel) {
  return run_chains(
      scene, options.direct, options.max_depth, render, mutations_per_pixel,
      [&](int min_edges, Film& film) { return Chains(scene, options, render, min_edges, film); },
      [&](const Chains& chains, LangevinResult& result) {
        if (render.check_gradients) result.gradient_check = chains.gradient_check();
      });
}

}  // namespace

LangevinResult render_langevin(const Scene& scene, const LangevinOptions& options,
                               const RenderOptions& render, double work) {
  options.validate();
  LangevinResult result;
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  arena.execute([&] {
    result = options.mode == Mode::Chain ? run_langevin(scene, options, render, work)
                                         : render_redistribution(scene, options, render, work);
  });
  return result;
}

}  // namespace driftlight
