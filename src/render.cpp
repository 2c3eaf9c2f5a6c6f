// SPDX-License-Identifier: Apache-2.0
#include "driftlight/render.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "driftlight/bootstrap.h"
#include "driftlight/chain.h"
#include "driftlight/film.h"
#include "stopwatch.h"

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

LangevinStatistics& LangevinStatistics::operator+=(const LangevinStatistics& other) {
  large_step += other.large_step;
  small_step += other.small_step;
  rejections += other.rejections;
  for (std::size_t n = 0; n < path_length.size(); ++n) path_length[n] += other.path_length[n];
  mutations += other.mutations;
  return *this;
}

namespace {

/// Runs all chains in rounds, each chain the same number of mutations, until the work or the time
/// is used up.
class ChainRunner {
 public:
  ChainRunner(std::vector<std::unique_ptr<Chain>>& chains, const RenderOptions& render)
      : chains_(chains), render_(render) {}

  /// True if it was stopped early.
  bool run(std::uint64_t mutations_per_chain) {
    std::uint64_t done = 0;
    while (true) {
      if (render_.stop != nullptr && render_.stop->load()) return true;
      const double elapsed = watch_.seconds();
      const double fraction =
          render_.time ? elapsed / *render_.time
                       : static_cast<double>(done) / static_cast<double>(mutations_per_chain);
      if (render_.progress) render_.progress({std::min(fraction, 1.0), elapsed});
      if (fraction >= 1.0) break;
      std::uint64_t round = next_round(done, elapsed);
      if (!render_.time) round = std::min(round, mutations_per_chain - done);
      tbb::parallel_for(std::size_t{0}, chains_.size(),
                        [&](std::size_t i) { chains_[i]->run(round); });
      done += round;
    }
    return false;
  }

 private:
  /// Mutations that take about a tenth of a second, or what is left of the time.
  std::uint64_t next_round(std::uint64_t done, double elapsed) const {
    if (done == 0) return 16;
    double seconds = 0.1;
    if (render_.time) seconds = std::min(seconds, *render_.time - elapsed);
    const double rate = static_cast<double>(done) / std::max(elapsed, 1e-6);
    return static_cast<std::uint64_t>(
        std::clamp(rate * seconds, 1.0, 16.0 * static_cast<double>(done)));
  }

  std::vector<std::unique_ptr<Chain>>& chains_;
  const RenderOptions& render_;
  Stopwatch watch_;
};

LangevinResult run_langevin(const Scene& scene, const LangevinOptions& options,
                            const RenderOptions& render, double mutations_per_pixel) {
  const PerspectiveCamera& camera = scene.camera();
  Stopwatch watch;
  PathSampler sampler(scene, options.max_depth, options.large_steps);
  const Bootstrap bootstrap(sampler, scene, options.bootstrap, render.seed);
  Film film(camera.film_width, camera.film_height);
  std::vector<std::unique_ptr<Chain>> chains;
  for (const PathSampler::Sample& start : bootstrap.resample(options.chains)) {
    const auto index = static_cast<std::uint64_t>(chains.size());
    chains.push_back(std::make_unique<Chain>(scene, sampler, options, film, start,
                                             Rng(render.seed, Stream::Chain, index),
                                             render.layers));
  }
  LangevinResult result;
  LangevinStatistics& statistics = result.statistics;
  statistics.bootstrap_seconds = watch.restart();
  const double mutations = mutations_per_pixel * camera.pixel_count();
  const auto per_chain =
      static_cast<std::uint64_t>(std::ceil(std::max(1.0, mutations / options.chains)));
  statistics.stopped = ChainRunner(chains, render).run(per_chain);

  // Sums in the order of the chains: the same for any number of threads.
  RunningMean weights = bootstrap.weights();
  for (const auto& chain : chains) {
    chain->flush();
    statistics += chain->statistics();
    weights += chain->weights();
  }
  statistics.b = weights.mean();
  statistics.b_error = weights.error();
  statistics.render_seconds = watch.seconds();
  const double count = std::max(1.0, static_cast<double>(statistics.mutations));
  result.image = film.develop(statistics.b * camera.pixel_count() / count);
  return result;
}

}  // namespace

LangevinResult render_langevin(const Scene& scene, const LangevinOptions& options,
                               const RenderOptions& render, double mutations_per_pixel) {
  options.validate();
  LangevinResult result;
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  arena.execute([&] { result = run_langevin(scene, options, render, mutations_per_pixel); });
  return result;
}

}  // namespace driftlight
