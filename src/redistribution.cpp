// SPDX-License-Identifier: Apache-2.0
#include "redistribution.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "driftlight/error.h"
#include "driftlight/film.h"
#include "exact_sum.h"
#include "found_path.h"
#include "pass_loop.h"
#include "pilot.h"
#include "probed_starts.h"
#include "remainder.h"
#include "sample_film.h"
#include "splitting_pilot.h"

namespace driftlight {
namespace {

/// Most chains that start from one sample, and how much longer than usual they may become.
constexpr double kMostChains = 16;
constexpr double kMostStretch = 16;
/// Least deposit of a mutation, in units of the brightness of a pixel's sample: below it more
/// mutations no longer pay.
constexpr double kLeastDeposit = 0.2;

/// What all samples of a render share.
struct Redistribution {
  const Scene& scene;
  const LangevinOptions& options;
  StepLayers* layers;
  Pilot pilot;
  Remainder remainder;
  Film film;        ///< of the chains, in units of `unit`
  Film split_film;  ///< of the particles, likewise
  double unit;      ///< bright enough that fixed point does not overflow
  double deposit;   ///< epsilon
  ExactSum remainders;
  std::optional<ProbedStarts> probed;  ///< if gradients are checked
  TemperedScenes levels;
  EmissionGuide top_guide;
  SplittingPlan plan;

  Redistribution(const Scene& of_scene, const LangevinOptions& with, const RenderOptions& render)
      : scene(of_scene),
        options(with),
        layers(render.layers),
        pilot(run_pilot(scene, options, render.seed)),
        remainder(scene, pilot.guide, pilot.brightness, options.redistribution.threshold),
        film(scene.camera().film_width, scene.camera().film_height),
        split_film(scene.camera().film_width, scene.camera().film_height),
        unit(64.0 * pilot.brightness.max()),
        deposit(kLeastDeposit),
        levels(scene,
               options.mode == Mode::Splitting ? options.splitting.levels : std::optional(0)),
        top_guide(levels[levels.top()]) {
    if (render.check_gradients) probed.emplace(scene, options, render.seed);
    if (levels.top() > 0) plan = plan_splitting(levels, splitter(), options, render.seed);
  }

  Splitter splitter() const {
    return {levels, top_guide, options, remainder, pilot.brightness, layers};
  }

  bool leaves_to_splitting(const PathTopology& path) const {
    return levels.carry(path) && plan.takes(LobeSequence(path));
  }

  /// From the mean remainder of a sample so far.
  void set_deposit(double samples) {
    const double mean = remainders.value() / samples;
    deposit = std::max(kLeastDeposit, mean / options.redistribution.mutations_per_sample);
  }

  /// Of the films, in the mean of so many passes.
  double unit_of(double passes) const { return unit / std::max(1.0, passes); }
  Image by_chains(double passes) const { return film.develop(unit_of(passes)); }
  Image by_particles(double passes) const { return split_film.develop(unit_of(passes)); }
  /// The image of the samples with what chains and particles have brought in so many passes.
  Image complete(Image image, double passes) const {
    const Image chains = by_chains(passes);
    const Image particles = by_particles(passes);
    for (std::size_t i = 0; i < image.rgb.size(); ++i)
      image.rgb[i] += chains.rgb[i] + particles.rgb[i];
    return image;
  }

  void count(const ChainFigures& figures) {
    accepted_.add(figures.small_step.accepted);
    const std::lock_guard lock(mutex_);
    statistics_.small_step.proposed += figures.small_step.proposed;
    statistics_.rejections += figures.rejections;
    ++statistics_.starts;
  }
  /// What the particles of one sample have brought, in units of the brightness about.
  void count_family(double sum, const std::vector<LevelFigures>& figures) {
    families_.add(sum / plan.deposit);
    squared_families_.add(sum * sum / (plan.deposit * plan.deposit));
    const std::lock_guard lock(mutex_);
    statistics_.levels.resize(std::max(statistics_.levels.size(), figures.size()));
    for (std::size_t k = 0; k < figures.size(); ++k) statistics_.levels[k] += figures[k];
  }
  LangevinStatistics statistics() const {
    LangevinStatistics result = statistics_;
    result.small_step.accepted = accepted_.value();
    for (const LevelFigures& level : result.levels) {
      result.small_step += level.steps;
      result.rejections += level.rejections;
    }
    result.mutations = result.small_step.proposed;
    if (!plan.some) return result;
    result.split_deposit = plan.deposit;
    result.split_rate = plan.rate;
    result.split_sequences = plan.known;
    const double sum = families_.value();
    if (sum > 0.0) result.effective_families = sum * sum / squared_families_.value();
    return result;
  }

 private:
  ExactSum accepted_;
  ExactSum families_;  ///< in particles
  ExactSum squared_families_;
  std::mutex mutex_;
  LangevinStatistics statistics_;
};

/// One bidirectional sample, then the chains that start from it.
class RedistributionSampler {
 public:
  explicit RedistributionSampler(Redistribution& common)
      : common_(common),
        tracer_(common.scene, common.pilot.guide, MisHeuristic::Balance, common.options.max_depth),
        chain_(common.scene, common.options.kernel, common.remainder, common.layers),
        splitter_(common.splitter()) {}

  void sample(const Vec2d& film, Rng& rng, SampleFilm::Sink& film_sink) {
    starts_.clear();
    Sink sink{*this, film, film_sink};
    tracer_.sample(film, rng, sink);
    for (const Start& start : starts_) spread(start, rng);
    if (common_.plan.some) split(film, rng);
  }

 private:
  /// A path with a remainder, times its roulette.
  struct Start {
    PathTopology topology;
    PathCoordinates coordinates;
    Contribution contribution;
    Share share;
    double remainder;
  };

  /// Puts on the film what samples carry.
  struct Sink {
    RedistributionSampler& sampler;
    Vec2d film;
    SampleFilm::Sink& film_sink;

    void add(const Rgbd& value, const FoundPath& path) {
      film_sink.add(value * sampler.share_of_sample(film, value, path));
    }
    void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
      film_sink.splat(at, value * sampler.share_of_sample(at, value, path));
    }
  };

  /// min(w, tau) / w; keeps the path as a start if that is below 1.
  double share_of_sample(const Vec2d& film, const Rgbd& value, const FoundPath& path) {
    const double tau = common_.remainder.tau();
    // By balance weights the value is f / q.
    const double w = luminance(value) / (path.roulette * common_.pilot.brightness(film));
    if (!(w > tau)) return 1.0;
    const auto sample = state_of(common_.scene, path, common_.options.phase_space);
    if (!sample) return 1.0;
    Start start{sample->topology, sample->coordinates,
                contribution(common_.scene, sample->topology, sample->coordinates), Share{}, 0.0};
    start.share = common_.remainder.share(start.topology, start.coordinates, start.contribution);
    if (!std::isfinite(start.share.log_remainder)) return 1.0;
    start.remainder = path.roulette * (start.share.w - tau);
    if (!common_.leaves_to_splitting(start.topology)) starts_.push_back(start);
    return tau / start.share.w;
  }

  /// Chains of mutations that deposit epsilon each; if they would be too many, then longer ones,
  /// and if these are too long, mutations that deposit more.
  void spread(const Start& start, Rng& rng) {
    common_.remainders.add(start.remainder);
    const double length = common_.options.redistribution.chain_length;
    double deposit = common_.deposit;
    double mutations = length;
    double chains = std::floor(start.remainder / (deposit * length) + rng.uniform());
    if (chains > kMostChains) {
      mutations =
          std::ceil(std::min(start.remainder / (deposit * kMostChains), kMostStretch * length));
      chains = kMostChains;
      deposit = start.remainder / (mutations * chains);
    }
    if (!(chains > 0.0)) return;
    std::optional<GradientProbe> probe =
        common_.probed ? common_.probed->probe(start.contribution, chains * mutations)
                       : std::nullopt;
    chain_.observe(probe ? &*probe : nullptr);
    chain_.start_at(start.topology, start.coordinates, start.contribution, start.share);
    for (double i = 0; i < chains; ++i)
      chain_.run(static_cast<std::uint64_t>(mutations), rng,
                 [&](const Share& share, const Rgbd& color, double weight) {
                   common_.film.splat(share.film, color,
                                      weight * deposit * share.brightness / common_.unit);
                 });
    common_.count(chain_.take_statistics());
    if (probe) common_.probed->take(*probe);
  }

  /// The remainder that is left to splitting.
  void split(const Vec2d& film, Rng& rng) {
    const double rate = common_.plan.rate;
    const double samples = std::floor(rate + rng.uniform());
    for (double i = 0; i < samples; ++i) split_sample(film, 1.0 / rate, rng);
  }
  void split_sample(const Vec2d& film, double weight, Rng& rng) {
    double family = 0.0;
    splitter_.sample(film, common_.plan, rng,
                     [&](LobeSequence, int, const Share& share, const Rgbd& color, double visit) {
                       const double amount = weight * visit;
                       family += visit;
                       common_.split_film.splat(share.film, color,
                                                amount * share.brightness / common_.unit);
                     });
    common_.count_family(family, splitter_.take_figures());
  }

  Redistribution& common_;
  BidirectionalTracer tracer_;
  RemainderChain chain_;
  Splitter splitter_;
  std::vector<Start> starts_;
};

}  // namespace

LangevinResult render_redistribution(const Scene& scene, const LangevinOptions& options,
                                     const RenderOptions& render, double samples_per_pixel) {
  RenderClock clock(render);
  Redistribution common(scene, options, render);
  const double pilot_seconds = clock.seconds();
  SampleFilm film(scene.camera(), render.seed, 0);
  const RedistributionSampler sampler(common);
  PathResult samples = run_passes(
      render, clock, static_cast<int>(samples_per_pixel),
      [&](std::uint64_t index) {
        if (common.probed) common.probed->begin_pass(index);
        film.pass(index, sampler);
        common.set_deposit(static_cast<double>(index + 1) * scene.camera().pixel_count());
      },
      [&](double passes) { return common.complete(film.image(passes), passes); });

  LangevinResult result;
  result.statistics = common.statistics();
  if (common.probed) result.gradient_check = common.probed->table();
  result.image = std::move(samples.image);
  result.statistics.b = mean_luminance(result.image);
  if (!(result.statistics.b > 0.0) && !samples.stopped)
    throw InputError("no path from the sensor to an emitter carries light");
  result.statistics.remainder = mean_luminance(common.by_chains(samples.samples_per_pixel));
  result.statistics.split = mean_luminance(common.by_particles(samples.samples_per_pixel));
  result.statistics.samples_per_pixel = samples.samples_per_pixel;
  result.statistics.stopped = samples.stopped;
  result.statistics.bootstrap_seconds = pilot_seconds;
  result.statistics.render_seconds = samples.render_seconds;
  return result;
}

}  // namespace driftlight
