// SPDX-License-Identifier: Apache-2.0
#include "redistribution.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "chain_counts.h"
#include "chain_pilot.h"
#include "chain_schedule.h"
#include "driftlight/error.h"
#include "driftlight/film.h"
#include "exact_sum.h"
#include "mixed_chain.h"
#include "pass_loop.h"
#include "pilot.h"
#include "probed_starts.h"
#include "remainder.h"
#include "sample_film.h"
#include "splitting_share.h"

namespace driftlight {
namespace {

/// What is left above this height, over that of the rest's floor, has chains of its own, so many
/// times as long: they need longer to find their way out of such a place, and their light would
/// show as a spot. Longer chains for the start's sake would not be in balance (chain_schedule.h);
/// but either part of what is left is a target by itself.
constexpr double kHeavy = 256;
constexpr double kHeavyLength = 16;

/// What all samples of a render share.
struct Redistribution {
  const Scene& scene;
  const LangevinOptions& options;
  StepLayers* layers;
  Pilot pilot;
  Remainder remainder;
  Film film;  ///< of the chains, in units of `unit`
  SplittingShare splitting;
  ChainPlan plan;
  std::array<Remainder, 2> parts;  ///< of the remainder, for chains
  double unit;
  double deposit;  ///< epsilon
  ExactSum remainders;
  ChainCounts counts;                  ///< of the chains
  std::optional<ProbedStarts> probed;  ///< if gradients are checked

  Redistribution(const Scene& of_scene, const LangevinOptions& with, const RenderOptions& render)
      : scene(of_scene),
        options(with),
        layers(render.layers),
        pilot(run_pilot(scene, options, render.seed)),
        remainder(scene, pilot.guide, pilot.brightness,
                  options.redistribution.threshold.value_or(1.0)),
        film(scene.camera().film_width, scene.camera().film_height, scene.camera().filter),
        splitting(scene, options, render, remainder, pilot.brightness),
        plan(plan_chains(scene, options, pilot, splitting, render.seed)),
        parts(Remainder(scene, pilot.guide, pilot.brightness, plan.threshold)
                  .split_at(kHeavy * std::max(1.0, plan.threshold))),
        unit(pilot.brightness.film_unit()),
        deposit(deposit_for(0.0, plan.mutations_per_sample)) {
    remainder.set_tau(plan.threshold);
    if (render.check_gradients)
      probed.emplace(scene, options, scene.camera().pixel_count() * plan.mutations_per_sample,
                     render.seed);
  }

  /// From the mean remainder of a sample so far.
  void set_deposit(double samples) {
    deposit = deposit_for(remainders.value() / samples, plan.mutations_per_sample);
  }

  /// Of the films, in the mean of so many passes.
  double unit_of(double passes) const { return unit / std::max(1.0, passes); }
  Image by_chains(double passes) const { return film.develop(unit_of(passes)); }
  /// The image of the samples with what chains and particles have brought in so many passes.
  Image complete(Image image, double passes) const {
    const Image chains = by_chains(passes);
    const Image particles = splitting.image(passes);
    for (std::size_t i = 0; i < image.rgb.size(); ++i)
      image.rgb[i] += chains.rgb[i] + particles.rgb[i];
    return image;
  }
};

/// One bidirectional sample, the chains that start from it, and the particles beside it.
class RedistributionSampler {
 public:
  explicit RedistributionSampler(Redistribution& common)
      : common_(common),
        tracer_(common.scene, common.pilot.guide, MisHeuristic::Power, common.options.max_depth),
        chains_{chain(0), chain(1)},
        splitting_(common.splitting) {}

  void sample(const Vec2d& film, Rng& rng, SampleFilm::Sink& film_sink) {
    left_ = 0.0;
    starts_ = 0;
    Sink sink{*this, film, rng, film_sink};
    tracer_.sample(film, rng, sink);
    if (left_ > 0.0) common_.remainders.add(left_);
    if (starts_ > 0) {
      common_.counts.add(chains_[0].take_statistics(), starts_);
      common_.counts.add(chains_[1].take_statistics(), 0);
    }
    splitting_.sample(film, rng);
  }

 private:
  /// Puts on the film what samples carry.
  struct Sink {
    RedistributionSampler& sampler;
    Vec2d film;
    Rng& rng;
    SampleFilm::Sink& film_sink;

    void add(const Rgbd& value, const FoundPath& path) {
      film_sink.add(value * sampler.share_of_sample(film, value, path, rng));
    }
    void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
      film_sink.splat(at, value * sampler.share_of_sample(at, value, path, rng));
    }
  };

  /// min(w, tau) / w; what is left is spread at once.
  double share_of_sample(const Vec2d& film, const Rgbd& value, const FoundPath& path, Rng& rng) {
    const double w = common_.remainder.weight(film, value, path);
    const double left = common_.remainder.left(w, path);
    if (!(left > 0.0)) return 1.0;
    if (!common_.splitting.takes(path)) {
      left_ += left;
      for (const std::size_t part : {0U, 1U})
        spread(film, value, part, common_.parts.at(part).left(w, path), path, rng);
    }
    return 1.0 - left / (path.factor * w);
  }

  MixedChain chain(std::size_t part) const {
    return {common_.scene,          common_.options,
            common_.options.kernel, common_.plan.perturbations,
            kManifoldsOfChains,     common_.parts.at(part),
            common_.layers};
  }

  /// Spreads a part of what is left by chains of mutations that deposit epsilon each.
  void spread(const Vec2d& film, const Rgbd& value, std::size_t part, double left,
              const FoundPath& path, Rng& rng) {
    if (!(left > 0.0)) return;
    MixedChain& chain = chains_.at(part);
    const double length =
        (part == 0 ? 1.0 : kHeavyLength) * common_.options.redistribution.chain_length;
    const ChainSchedule schedule = schedule_chains(left, common_.deposit, length, rng);
    if (!(schedule.chains > 0.0)) return;
    ++starts_;
    const auto deposit = [&](const Share& share, const Rgbd& color, double weight) {
      common_.film.splat(share.film, color,
                         weight * schedule.deposit * share.brightness / common_.unit);
    };
    if (!chain.start_at(path)) {
      // No state of a chain: as if it never moved.
      Share stays;
      stays.film = film;
      stays.brightness = common_.pilot.brightness(film);
      deposit(stays, value / luminance(value), schedule.chains * schedule.mutations);
      return;
    }
    std::optional<GradientProbe> probe =
        common_.probed && part == 0 && chain.start()
            ? common_.probed->probe(chain.start()->contribution,
                                    schedule.chains * schedule.mutations)
            : std::nullopt;
    chain.observe(probe ? &*probe : nullptr);
    for (double i = 0; i < schedule.chains; ++i)
      chain.run(static_cast<std::uint64_t>(schedule.mutations), rng, deposit);
    if (probe) common_.probed->take(*probe);
  }

  Redistribution& common_;
  BidirectionalTracer tracer_;
  std::array<MixedChain, 2> chains_;  ///< of the parts
  SplittingShare::Sampler splitting_;
  // Of the sample in hand.
  double left_ = 0;  ///< to chains
  std::uint64_t starts_ = 0;
};

/// What each way of carrying light has on the film, and the families of particles.
Layers shares(const Image& samples, const Image& chains, const Image& particles,
              const FamilyTiles& families) {
  Layers layers{.width = samples.width, .height = samples.height, .names = {}, .values = {}};
  for (const char* name : {"samples", "chains", "particles"})
    for (const char* channel : {".R", ".G", ".B"})
      layers.names.push_back(std::string(name) + channel);
  layers.names.emplace_back("families");
  for (int y = 0; y < layers.height; ++y) {
    for (int x = 0; x < layers.width; ++x) {
      for (const Image* image : {&samples, &chains, &particles})
        for (int c = 0; c < 3; ++c) layers.values.push_back(image->pixel(x, y)[c]);
      layers.values.push_back(static_cast<float>(families.effective(x, y)));
    }
  }
  return layers;
}

}  // namespace

LangevinResult render_redistribution(const Scene& scene, const LangevinOptions& options,
                                     const RenderOptions& render, double samples_per_pixel) {
  if (options.redistribution.perturbations.value_or(0.0) > 0.0)
    require_pinhole(scene, "option perturbations");
  if (options.splitting.last_perturbations.value_or(0.0) > 0.0)
    require_pinhole(scene, "option last_perturbations");
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
  const double passes = samples.samples_per_pixel;
  const Image chains = common.by_chains(passes);
  const Image particles = common.splitting.image(passes);
  if (render.shares != nullptr)
    *render.shares = shares(film.image(passes), chains, particles, common.splitting.families());
  result.image = std::move(samples.image);
  result.statistics = common.counts.statistics();
  common.splitting.report(particles, result.statistics);
  if (common.probed) result.gradient_check = common.probed->table();
  result.statistics.b = mean_luminance(result.image);
  if (!(result.statistics.b > 0.0) && !samples.stopped)
    throw InputError("no path from the sensor to an emitter carries light");
  result.statistics.remainder = mean_luminance(chains);
  result.statistics.threshold = common.plan.threshold;
  result.statistics.perturbations = common.plan.perturbations;
  result.statistics.mutations_per_sample = common.plan.mutations_per_sample;
  result.statistics.light_subpaths = common.pilot.guide.rate();
  result.statistics.samples_per_pixel = samples.samples_per_pixel;
  result.statistics.stopped = samples.stopped;
  result.statistics.bootstrap_seconds = pilot_seconds;
  result.statistics.render_seconds = samples.render_seconds;
  return result;
}

}  // namespace driftlight
