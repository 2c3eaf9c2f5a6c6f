// SPDX-License-Identifier: Apache-2.0
/// Metropolis light transport in primary sample space, of all strategies at once or of one at a
/// time.
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "chain_run.h"
#include "driftlight/render.h"
#include "primary_chain.h"
#include "scale_tuning.h"
#include "strategy_chain.h"
#include "systematic_resampling.h"

namespace driftlight {
namespace {

/// Mutations of the pilot of LMC's cache, for each of its points.
constexpr double kCacheMutations = 64.0;
/// Of pilots, one over the share of the bootstrap.
constexpr int kPilotBootstrap = 8;

/// Points of PrimaryTarget, and chains of them.
class PointSampler {
 public:
  using Point = PrimaryPoint;
  using Chain = PrimaryChain;

  PointSampler(const PrimaryTarget& target, const PrimaryOptions& options)
      : target_(target), options_(options) {}

  Point point(std::uint64_t seed, std::size_t i, int /*edges*/) const {
    return {options_, seed, Stream::Bootstrap, i};
  }
  double target(Point& point) { return target_(point, splats_); }
  std::unique_ptr<Chain> chain(const Point& start, Film& film, const Rng& rng) const {
    return std::make_unique<Chain>(target_, options_, film, start, rng);
  }

 private:
  PrimaryTarget target_;
  const PrimaryOptions& options_;
  std::vector<PrimarySplat> splats_;
};

/// Likewise of StrategyTarget.
class NumbersSampler {
 public:
  using Point = StrategyNumbers;
  using Chain = StrategyChain;

  /// The cache may be null.
  NumbersSampler(const StrategyTarget& target, const StrategyMethod& method,
                 std::shared_ptr<const GradientCache> cache)
      : target_(target), method_(method), cache_(std::move(cache)) {}

  Point point(std::uint64_t seed, std::size_t i, int edges) const {
    Rng rng(seed, Stream::Bootstrap, i);
    return {edges, target_.has_lens(), rng};
  }
  double target(const Point& point) {
    if (common_options(method_).large_steps == StrategyLargeSteps::All) {
      Rng any(0, Stream::Bootstrap, 0);
      target_.sample(point, any, place_);
      return place_.target;
    }
    target_(point, point.strategy(), place_);
    return (point.edges() + 1) * place_.target;
  }
  std::unique_ptr<Chain> chain(const Point& start, Film& film, const Rng& rng) const {
    return std::make_unique<Chain>(target_, method_, cache_.get(), film, start, rng);
  }

 private:
  StrategyTarget target_;
  const StrategyMethod& method_;
  std::shared_ptr<const GradientCache> cache_;
  PrimaryPlace place_;
};

/// Whether each chain has paths of one length, of which all then have their own integrals.
enum class Lengths { Together, Apart };

/// The chains with what they are started from.
template <class Sampler>
class PrimaryChains {
 public:
  using Chain = typename Sampler::Chain;

  /// No chains if paths of `min_edges` and more carry no light.
  PrimaryChains(const Sampler& sampler, const PrimaryOptions& options, Lengths lengths,
                int min_edges, std::uint64_t seed, Film& film)
      : sampler_(sampler),
        options_(options),
        seed_(seed),
        first_length_(lengths == Lengths::Apart ? min_edges : options.max_depth) {
    if (min_edges > options.max_depth) return;
    bootstrap_weights_.resize(static_cast<std::size_t>(options.max_depth - first_length_) + 1);
    const std::vector<double> values = bootstrap();
    for (std::size_t i = 0; i < values.size(); ++i)
      bootstrap_weights_[i % bootstrap_weights_.size()].add(values[i]);
    if (!(bootstrap_mean() > 0.0)) return;
    Rng rng(seed, Stream::Resampling, 0);
    for (const std::size_t i : systematic_resampling(values, options.chains, rng.uniform()))
      all.push_back(sampler_.chain(point(i), film, Rng(seed, Stream::Chain, all.size())));
  }

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

  std::vector<std::unique_ptr<Chain>> all;

 private:
  static double integral(const std::vector<RunningMean>& weights) {
    double sum = 0.0;
    for (const RunningMean& length : weights) sum += length.mean();
    return sum;
  }
  std::size_t length_index(const Chain& chain) const {
    if constexpr (requires { chain.edges(); })
      return static_cast<std::size_t>(chain.edges() - first_length_);
    else
      return 0;
  }

  /// Sample i of the bootstrap, whose lengths take turns.
  typename Sampler::Point point(std::size_t i) const {
    const int turn = static_cast<int>(i % bootstrap_weights_.size());
    return sampler_.point(seed_, i, first_length_ + turn);
  }

  /// The target at as many samples of each length.
  std::vector<double> bootstrap() const {
    constexpr std::size_t kSamplesPerTask = 256;
    const std::size_t lengths = bootstrap_weights_.size();
    const auto wanted = static_cast<std::size_t>(options_.bootstrap);
    std::vector<double> values((wanted + lengths - 1) / lengths * lengths);
    tbb::parallel_for(std::size_t{0}, (values.size() + kSamplesPerTask - 1) / kSamplesPerTask,
                      [&](std::size_t task) {
                        Sampler sampler = sampler_;
                        for (std::size_t i = task * kSamplesPerTask;
                             i < std::min((task + 1) * kSamplesPerTask, values.size()); ++i) {
                          auto at = point(i);
                          values[i] = sampler.target(at);
                        }
                      });
    return values;
  }

  Sampler sampler_;
  const PrimaryOptions& options_;
  std::uint64_t seed_;
  int first_length_;                            ///< of those apart; else the longest path
  std::vector<RunningMean> bootstrap_weights_;  ///< of each length, if they are apart
};

/// Runs chains of the sampler that sampler_of(min_edges) returns.
template <class SamplerOf>
LangevinResult render_primary(const Scene& scene, const PrimaryOptions& options,
                              const RenderOptions& render, double mutations_per_pixel,
                              Lengths lengths, const SamplerOf& sampler_of) {
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  return arena.execute([&] {
    return run_chains(
        scene, options.direct, options.max_depth, render, mutations_per_pixel,
        [&](int min_edges, Film& film) {
          return PrimaryChains(sampler_of(min_edges), options, lengths, min_edges, render.seed,
                               film);
        },
        [](const auto&, LangevinResult&) {});
  });
}

/// What chains of their own, which adapt as they go and are then forgotten, know of gradients. So
/// the chains of the render do not depend on it.
std::shared_ptr<const GradientCache> run_cache_pilot(const Scene& scene,
                                                     const StrategyTarget& target, Lengths lengths,
                                                     int min_edges, const LmcOptions& options,
                                                     std::uint64_t seed) {
  LmcOptions online = options;
  online.bootstrap = std::max(1, options.bootstrap / kPilotBootstrap);
  const StrategyMethod method = online;
  Film unseen(scene.camera().film_width, scene.camera().film_height, scene.camera().filter);
  const PrimaryChains chains(NumbersSampler(target, method, nullptr), online, lengths, min_edges,
                             ~seed, unseen);
  std::vector<std::vector<GradientCache::Point>> points(chains.all.size());
  const auto mutations = static_cast<std::uint64_t>(
      std::ceil(kCacheMutations * options.cache / static_cast<double>(options.chains)));
  tbb::parallel_for(std::size_t{0}, chains.all.size(), [&](std::size_t i) {
    chains.all[i]->record(points[i]);
    chains.all[i]->run(mutations);
  });
  std::vector<GradientCache::Point> all;
  for (const auto& of_chain : points) all.insert(all.end(), of_chain.begin(), of_chain.end());
  return std::make_shared<const GradientCache>(all, options);
}

/// Tunes the scale of the steps of `method`, which has these options, by chains of a pilot.
void run_scale_pilot(const Scene& scene, const StrategyTarget& target, Lengths lengths,
                     int min_edges, const StrategyMethod& method, MalaOptions& options,
                     std::uint64_t seed) {
  PrimaryOptions fewer = options;
  fewer.bootstrap = std::max(1, options.bootstrap / kPilotBootstrap);
  Film unseen(scene.camera().film_width, scene.camera().film_height, scene.camera().filter);
  const PrimaryChains chains(NumbersSampler(target, method, nullptr), fewer, lengths, min_edges,
                             ~seed, unseen);
  if (!chains.all.empty()) tune_scale(options.target_acceptance, chains.all, options.kernel.scale);
}

template <class Options>
LangevinResult render_by_strategies(const Scene& scene, const Options& options,
                                    const RenderOptions& render, double mutations_per_pixel) {
  options.validate();
  const EmissionGuide unguided(scene);
  StrategyMethod method = options;
  const Lengths lengths =
      options.large_steps == StrategyLargeSteps::One ? Lengths::Apart : Lengths::Together;
  return render_primary(scene, options, render, mutations_per_pixel, lengths, [&](int min_edges) {
    const StrategyTarget target(scene, unguided, min_edges, options.max_depth);
    std::shared_ptr<const GradientCache> cache;
    if constexpr (std::is_same_v<Options, LmcOptions>) {
      if (options.cache > 0)
        cache = run_cache_pilot(scene, target, lengths, min_edges, options, render.seed);
    }
    if constexpr (std::is_same_v<Options, MalaOptions>) {
      if (options.target_acceptance > 0.0)
        run_scale_pilot(scene, target, lengths, min_edges, method, std::get<MalaOptions>(method),
                        render.seed);
    }
    return NumbersSampler(target, method, std::move(cache));
  });
}

}  // namespace

LangevinResult render_pssmlt(const Scene& scene, const PssmltOptions& options,
                             const RenderOptions& render, double mutations_per_pixel) {
  options.validate();
  const EmissionGuide unguided(scene);
  return render_primary(
      scene, options, render, mutations_per_pixel, Lengths::Together, [&](int min_edges) {
        return PointSampler(PrimaryTarget(scene, unguided, min_edges, options.max_depth), options);
      });
}

LangevinResult render_mmlt(const Scene& scene, const MmltOptions& options,
                           const RenderOptions& render, double mutations_per_pixel) {
  return render_by_strategies(scene, options, render, mutations_per_pixel);
}

LangevinResult render_h2mc(const Scene& scene, const H2mcOptions& options,
                           const RenderOptions& render, double mutations_per_pixel) {
  return render_by_strategies(scene, options, render, mutations_per_pixel);
}

LangevinResult render_lmc(const Scene& scene, const LmcOptions& options,
                          const RenderOptions& render, double mutations_per_pixel) {
  return render_by_strategies(scene, options, render, mutations_per_pixel);
}

LangevinResult render_mala(const Scene& scene, const MalaOptions& options,
                           const RenderOptions& render, double mutations_per_pixel) {
  return render_by_strategies(scene, options, render, mutations_per_pixel);
}

}  // namespace driftlight
