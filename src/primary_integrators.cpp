// SPDX-License-Identifier: Apache-2.0
/// Metropolis light transport in primary sample space, of all strategies at once or of one at a
/// time.
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "chain_run.h"
#include "driftlight/render.h"
#include "primary_chain.h"
#include "systematic_resampling.h"

namespace driftlight {
namespace {

using Strategies = PrimaryTarget::Strategies;

/// The chains with what they are started from.
class PrimaryChains {
 public:
  /// No chains if paths of `min_edges` and more carry no light.
  PrimaryChains(const Scene& scene, const PrimaryOptions& options, Strategies strategies,
                int min_edges, std::uint64_t seed, Film& film)
      : options_(options),
        seed_(seed),
        strategies_(strategies),
        min_edges_(min_edges),
        unguided_(scene),
        target_(scene, unguided_, strategies, min_edges, options.max_depth) {
    if (min_edges > options.max_depth) return;
    bootstrap_weights_.resize(strategies == Strategies::One
                                  ? static_cast<std::size_t>(options.max_depth - min_edges) + 1
                                  : 1);
    const std::vector<double> values = bootstrap();
    for (std::size_t i = 0; i < values.size(); ++i)
      bootstrap_weights_[i % bootstrap_weights_.size()].add(values[i]);
    if (!(bootstrap_mean() > 0.0)) return;
    Rng rng(seed, Stream::Resampling, 0);
    for (const std::size_t i : systematic_resampling(values, options.chains, rng.uniform()))
      all.push_back(std::make_unique<PrimaryChain>(target_, options, film, point(i),
                                                   Rng(seed, Stream::Chain, all.size())));
  }

  // The chains' targets refer to it.
  PrimaryChains(const PrimaryChains&) = delete;
  PrimaryChains& operator=(const PrimaryChains&) = delete;

  /// Deposits all that the chains have gathered.
  void flush() {
    for (const auto& chain : all) chain->flush();
  }
  /// Statistics in the order of the chains: the same for any number of threads.
  LangevinStatistics statistics() const {
    LangevinStatistics sum;
    std::vector<RunningMean> weights = bootstrap_weights_;
    for (const auto& chain : all) {
      sum += chain->statistics();
      weights[length_index(*chain)] += chain->weights();
    }
    sum.large_step_probability = options_.large_step_probability;
    sum.b = integral(weights);
    double variance = 0.0;
    for (const RunningMean& length : weights) variance += length.error() * length.error();
    sum.b_error = std::sqrt(variance);
    return sum;
  }

  /// Of the target over all lengths, as the bootstrap has found it.
  double bootstrap_mean() const { return integral(bootstrap_weights_); }

  std::vector<std::unique_ptr<PrimaryChain>> all;

 private:
  static double integral(const std::vector<RunningMean>& weights) {
    double sum = 0.0;
    for (const RunningMean& length : weights) sum += length.mean();
    return sum;
  }
  std::size_t length_index(const PrimaryChain& chain) const {
    return strategies_ == Strategies::One ? static_cast<std::size_t>(chain.edges() - min_edges_)
                                          : 0;
  }

  /// Sample i of the bootstrap, whose lengths take turns.
  PrimaryPoint point(std::size_t i) const {
    PrimaryPoint result(options_, seed_, Stream::Bootstrap, i);
    if (strategies_ == Strategies::One)
      result.edges = min_edges_ + static_cast<int>(i % bootstrap_weights_.size());
    return result;
  }

  /// The target at as many samples of each length.
  std::vector<double> bootstrap() const {
    constexpr std::size_t kTask = 256;
    const std::size_t lengths = bootstrap_weights_.size();
    const auto wanted = static_cast<std::size_t>(options_.bootstrap);
    std::vector<double> values((wanted + lengths - 1) / lengths * lengths);
    tbb::parallel_for(std::size_t{0}, (values.size() + kTask - 1) / kTask, [&](std::size_t task) {
      PrimaryTarget target = target_;
      std::vector<PrimarySplat> splats;
      for (std::size_t i = task * kTask; i < std::min((task + 1) * kTask, values.size()); ++i) {
        PrimaryPoint at = point(i);
        values[i] = target(at, splats);
      }
    });
    return values;
  }

  const PrimaryOptions& options_;
  std::uint64_t seed_;
  Strategies strategies_;
  int min_edges_;
  EmissionGuide unguided_;
  PrimaryTarget target_;
  std::vector<RunningMean> bootstrap_weights_;  ///< of each length, if they are apart
};

LangevinResult render_primary(const Scene& scene, const PrimaryOptions& options,
                              const RenderOptions& render, double mutations_per_pixel,
                              Strategies strategies) {
  options.validate();
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  return arena.execute([&] {
    return run_chains(
        scene, options.direct, options.max_depth, render, mutations_per_pixel,
        [&](int min_edges, Film& film) {
          return PrimaryChains(scene, options, strategies, min_edges, render.seed, film);
        },
        [](const PrimaryChains&, LangevinResult&) {});
  });
}

}  // namespace

LangevinResult render_pssmlt(const Scene& scene, const PssmltOptions& options,
                             const RenderOptions& render, double mutations_per_pixel) {
  return render_primary(scene, options, render, mutations_per_pixel, Strategies::All);
}

LangevinResult render_mmlt(const Scene& scene, const MmltOptions& options,
                           const RenderOptions& render, double mutations_per_pixel) {
  return render_primary(scene, options, render, mutations_per_pixel, Strategies::One);
}

}  // namespace driftlight
