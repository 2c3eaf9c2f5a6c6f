// SPDX-License-Identifier: Apache-2.0
#include "driftlight/render.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "driftlight/bootstrap.h"
#include "driftlight/chain.h"
#include "driftlight/error.h"
#include "driftlight/film.h"
#include "path_tracer.h"
#include "redistribution.h"
#include "render_clock.h"
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

LevelFigures& LevelFigures::operator+=(const LevelFigures& other) {
  particles += other.particles;
  died += other.died;
  ratio += other.ratio;
  squared_ratio += other.squared_ratio;
  steps += other.steps;
  rejections += other.rejections;
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

constexpr int kDirectDepth = 2;

/// The pass of direct light beside the chains.
class DirectPass {
 public:
  DirectPass(const Scene& scene, int max_depth, std::uint64_t seed)
      : sums_(scene, std::min(kDirectDepth, max_depth), seed) {}

  void pass() {
    const Stopwatch watch;
    sums_.pass(passes_++);
    seconds_ += watch.seconds();
  }
  /// Sets the ratio of its time to that of the chains, given their mean luminance. With A / t_d +
  /// B / t_c the sum of the squared errors, t_d / t_c = sqrt(A / B): the ratio of the brightnesses
  /// times that of the noise of one sample, about 1 / 4 as a chain needs some ten mutations for
  /// what an independent sample gives.
  void set_share(double chain_mean) {
    ratio_ = chain_mean > 0.0 ? std::clamp(0.25 * mean() / chain_mean, 0.02, 2.0) : 2.0;
  }
  double ratio() const { return ratio_; }

  /// Mean luminance so far.
  double mean() const { return mean_luminance(sums_.image(passes_)); }
  /// Adds what it has rendered.
  void add_to(Image& image) const {
    const Image own = sums_.image(passes_);
    for (std::size_t i = 0; i < own.rgb.size(); ++i) image.rgb[i] += own.rgb[i];
  }
  void report(LangevinStatistics& statistics) const {
    statistics.direct_mean = mean();
    statistics.direct_samples_per_pixel = static_cast<double>(passes_);
    statistics.direct_seconds = seconds_;
  }
  std::uint64_t passes() const { return passes_; }
  double seconds() const { return seconds_; }

 private:
  PixelSums sums_;
  std::uint64_t passes_ = 0;
  double seconds_ = 0;
  double ratio_ = 0;
};

/// Runs all chains in rounds, each chain the same number of mutations, and passes of direct light
/// between them, until the work or the time is used up. Either may be missing.
class Runner {
 public:
  Runner(std::vector<std::unique_ptr<Chain>>& chains, DirectPass* direct,
         const RenderOptions& render, RenderClock& clock, double mutations_per_pixel, double pixels)
      : chains_(chains),
        direct_(direct),
        render_(render),
        clock_(clock),
        pixels_(pixels),
        start_(clock.seconds()),
        mutations_(static_cast<std::uint64_t>(
            std::ceil(std::max(1.0, mutations_per_pixel * pixels /
                                        std::max(1.0, static_cast<double>(chains.size())))))),
        passes_(direct != nullptr ? static_cast<std::uint64_t>(std::ceil(
                                        std::max(1.0, direct->ratio() * mutations_per_pixel)))
                                  : 0) {}

  /// True if it was stopped early. `develop()` is the image so far.
  template <class Develop>
  bool run(const Develop& develop) {
    while (true) {
      if (render_.stop != nullptr && render_.stop->load()) return true;
      const double elapsed = clock_.seconds();
      const double fraction = render_.time ? elapsed / *render_.time : work_done();
      if (render_.progress) render_.progress({std::min(fraction, 1.0), elapsed});
      if (chains_.empty() || done_ > 0) {
        clock_.reach(fraction, mutations_per_pixel(), develop);
        if (fraction >= 1.0) return false;
      }
      if (direct_is_due(elapsed - start_))
        direct_->pass();
      else
        round(elapsed);
    }
  }

 private:
  double work_done() const {
    const double chains =
        chains_.empty() ? 1.0 : static_cast<double>(done_) / static_cast<double>(mutations_);
    if (direct_ == nullptr) return chains;
    return std::min(chains, static_cast<double>(direct_->passes()) / static_cast<double>(passes_));
  }

  double mutations_per_pixel() const {
    return static_cast<double>(done_) * static_cast<double>(chains_.size()) / pixels_;
  }

  bool direct_is_due(double elapsed) const {
    if (direct_ == nullptr) return false;
    if (chains_.empty()) return true;
    if (!render_.time) return direct_->passes() < passes_;
    return direct_->seconds() < direct_->ratio() / (1.0 + direct_->ratio()) * elapsed;
  }

  void round(double elapsed) {
    const Stopwatch watch;
    std::uint64_t mutations = next_round(elapsed);
    if (!render_.time) mutations = std::min(mutations, before_snapshot());
    tbb::parallel_for(std::size_t{0}, chains_.size(),
                      [&](std::size_t i) { chains_[i]->run(mutations); });
    done_ += mutations;
    seconds_ += watch.seconds();
  }

  /// Mutations up to the next snapshot: where it is taken must not depend on the machine's speed.
  std::uint64_t before_snapshot() const {
    const double there = std::ceil(clock_.next_snapshot() * static_cast<double>(mutations_));
    return std::max(done_ + 1, static_cast<std::uint64_t>(there)) - done_;
  }

  /// Mutations that take about a tenth of a second, or what is left of the time.
  std::uint64_t next_round(double elapsed) const {
    if (done_ == 0) return 16;
    double seconds = 0.1;
    if (render_.time) seconds = std::min(seconds, *render_.time - elapsed);
    const double rate = static_cast<double>(done_) / std::max(seconds_, 1e-6);
    return static_cast<std::uint64_t>(
        std::clamp(rate * seconds, 1.0, 16.0 * static_cast<double>(done_)));
  }

  std::vector<std::unique_ptr<Chain>>& chains_;
  DirectPass* direct_;
  const RenderOptions& render_;
  RenderClock& clock_;
  double pixels_;
  double start_;             ///< on the clock
  std::uint64_t mutations_;  ///< of each chain, if no time is given
  std::uint64_t passes_;     ///< of direct light, if no time is given
  std::uint64_t done_ = 0;
  double seconds_ = 0;
};

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
    for (const PathSampler::Sample& start : bootstrap.resample(options.chains)) {
      const auto index = static_cast<std::uint64_t>(all.size());
      all.push_back(std::make_unique<Chain>(scene, *sampler, options, film, start,
                                            Rng(render.seed, Stream::Chain, index), render.layers));
    }
    if (!render.check_gradients) return;
    for (std::uint64_t i = 0; i < all.size(); ++i)
      probes.emplace_back(scene, options.kernel, render.seed, i);
    for (std::size_t i = 0; i < all.size(); ++i) all[i]->observe(probes[i]);
  }

  GradientTable gradient_check() const {
    GradientTable table;
    for (const GradientProbe& probe : probes)
      for (const CheckedPath& path : probe.paths()) table.add(path);
    return table;
  }

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
  const double pixels = scene.camera().pixel_count();
  RenderClock clock(render);
  const bool apart = options.direct == DirectLight::Apart;
  Film film(scene.camera().film_width, scene.camera().film_height);
  Chains chains(scene, options, render, apart ? kDirectDepth + 1 : 1, film);
  const double bootstrap_seconds = clock.seconds();
  std::optional<DirectPass> direct;
  if (apart) {
    direct.emplace(scene, options.max_depth, render.seed);
    direct->pass();
    direct->set_share(chains.bootstrap_weights.mean());
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
      Runner(chains.all, direct ? &*direct : nullptr, render, clock, mutations_per_pixel, pixels)
          .run(develop);

  LangevinResult result;
  result.image = develop();
  LangevinStatistics& statistics = result.statistics;
  statistics = chains.statistics();
  if (render.check_gradients) result.gradient_check = chains.gradient_check();
  statistics.stopped = stopped;
  statistics.bootstrap_seconds = bootstrap_seconds;
  statistics.render_seconds = clock.seconds() - bootstrap_seconds;
  if (direct) direct->report(statistics);
  return result;
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
