// SPDX-License-Identifier: Apache-2.0
#include "chain_pilot.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "bidirectional_tracer.h"
#include "chain_schedule.h"
#include "mixed_chain.h"

namespace driftlight {
namespace {

constexpr std::uint64_t kTask = 64;
/// Samples of the pilot before for each that follows chains; of these for each that first tells how
/// much samples leave.
constexpr std::uint64_t kFewer = 4;
/// Starts of chains that are followed, in the mean, over samples.
constexpr double kStarts = 1.0 / 16.0;
/// Share of perturbations in mixed chains.
constexpr double kMixed = 0.5;

/// A pilot errs, by tails above all that it does not see: another plan than the one that serves
/// almost everywhere, mixed chains for what is brighter than most, must promise so much more. On
/// `torus` pilots promised 1.5 times of high thresholds, which have 1.5 times the error. Over
/// chains of Langevin steps they promised up to 3.7 times of perturbed ones there, which have four
/// times the error; where all light comes through an opening 7 to 13 times.
double doubt(const ChainPlan& plan, std::size_t kind) {
  if (kind > 0) return 4.0;
  return plan.threshold == 1.0 && plan.mutations_per_sample == 4.0 ? 1.0 : 2.0;
}

/// What chains of one kind make of a start, over the probability with which two were followed; 0 if
/// they were not.
struct Spread {
  double kappa = 0;
  double overlap = 0;
  double home = 0;
};

/// A path that is brighter than the least threshold.
struct Bright {
  double factor;
  double w;
  bool is_seen;                    ///< the path of one edge
  bool starts_chains;              ///< else splitting takes what samples leave
  std::array<Spread, 2> spread{};  ///< by the kind of its chains

  double kept(double tau) const { return factor * std::min(w, own(tau)); }
  double left(double tau) const {
    return starts_chains ? factor * std::max(0.0, w - own(tau)) : 0.0;
  }

 private:
  double own(double tau) const { return is_seen ? Remainder::tau_seen(tau) : tau; }
};

/// What one sample has found.
struct Sample {
  double dim = 0;      ///< sum of w in its own pixel, without the bright
  double splats2 = 0;  ///< sum of squares of what it splats, without the bright
  std::vector<Bright> own;
  std::vector<Bright> splat;

  /// In its own pixel.
  double kept(double tau) const {
    double sum = dim;
    for (const Bright& bright : own) sum += bright.kept(tau);
    return sum;
  }
  double left(double tau) const {
    double sum = 0;
    for (const Bright& bright : own) sum += bright.left(tau);
    return sum;
  }
};

/// The plans among which the best is chosen.
struct Choices {
  std::vector<double> thresholds;     ///< rising
  std::vector<double> perturbations;  ///< by kind
  std::vector<double> mutations_per_sample;

  Choices(const Scene& scene, const RedistributionOptions& options, bool splits)
      : thresholds{1, 2, 4, 8, 16, 64, 256, 1024},
        perturbations{is_pinhole(scene.camera()) ? kMixed : 0.0},
        mutations_per_sample{4} {
    if (!splits) {
      thresholds.insert(thresholds.begin(), {1.0 / 64.0, 1.0 / 16.0, 1.0 / 4.0});
      mutations_per_sample.insert(mutations_per_sample.end(), {16.0, 64.0});
      if (is_pinhole(scene.camera())) perturbations.push_back(1);
    }
    if (options.perturbations) perturbations = {*options.perturbations};
    if (options.threshold) thresholds = {*options.threshold};
    if (options.mutations_per_sample) mutations_per_sample = {*options.mutations_per_sample};
  }

  /// Perturbations alone are for light of which no sample brings much: of what is bright a pilot
  /// sees too little to tell whether perturbed chains find their way.
  std::vector<ChainPlan> plans() const {
    std::vector<ChainPlan> plans;
    for (const double threshold : thresholds)
      for (const double share : perturbations)
        for (const double mutations : mutations_per_sample)
          if (share == (threshold < 1.0 ? perturbations.back() : perturbations.front()))
            plans.push_back({threshold, share, mutations});
    return plans;
  }
  double least_threshold() const { return thresholds.front(); }
  std::size_t kind(const ChainPlan& plan) const {
    return plan.perturbations == perturbations.front() ? 0 : 1;
  }
};

/// Runs samples, and follows single chains.
class Sampler {
 public:
  /// A chain is followed with probability left / light, at most 1.
  Sampler(const Scene& scene, const LangevinOptions& options, const Choices& choices,
          const Pilot& pilot, const Remainder& remainder, const SplittingShare& splitting,
          double light)
      : options_(options),
        choices_(choices),
        camera_(scene.camera()),
        remainder_(remainder),
        splitting_(splitting),
        tracer_(scene, pilot.guide, MisHeuristic::Power, options.max_depth),
        light_(light) {
    for (const double share : choices.perturbations)
      chains_.push_back(std::make_unique<MixedChain>(scene, options, options.kernel, share,
                                                     kManifoldsOfChains, remainder, nullptr));
  }

  Sample run(const Vec2d& film, Rng& rng) {
    sample_ = {};
    film_ = film;
    rng_ = &rng;
    tracer_.sample(film_, rng, *this);
    return std::move(sample_);
  }

  /// The sink of the tracer.
  void add(const Rgbd& value, const FoundPath& path) {
    const double w = remainder_.weight(film_, value, path);
    if (remainder_.left(w, path) > 0.0)
      sample_.own.push_back(bright(film_, w, path));
    else if (std::isfinite(w))
      sample_.dim += path.factor * w;
  }
  void splat(const Vec2d& film, const Rgbd& value, const FoundPath& path) {
    const double w = remainder_.weight(film, value, path);
    if (remainder_.left(w, path) > 0.0)
      sample_.splat.push_back(bright(film, w, path));
    else if (std::isfinite(w))
      sample_.splats2 += sqr(path.factor * w);
  }

 private:
  Bright bright(const Vec2d& film, double w, const FoundPath& path) {
    Bright bright{.factor = path.factor,
                  .w = w,
                  .is_seen = path.s + path.t == 2,
                  .starts_chains = !splitting_.takes(path)};
    const double chosen = std::min(1.0, bright.left(choices_.least_threshold()) / light_);
    if (chosen > 0.0 && rng_->uniform() < chosen) follow(film, path, chosen, bright);
    return bright;
  }

  /// By chains of one kind.
  void follow(const Vec2d& film, const FoundPath& path, double chosen, Bright& bright) {
    const std::size_t kind = chains_.size() > 1 && rng_->uniform() < 0.5 ? chains_.size() - 1 : 0;
    const double probability = chosen / static_cast<double>(chains_.size());
    MixedChain& chain = *chains_[kind];
    const Spread stays{1.0 / probability, 1.0 / probability, 1.0 / probability};
    bright.spread.at(kind) = chain.start_at(path) ? spread(film, probability, chain) : stays;
  }

  /// Of two chains from the start, which is at this film point.
  Spread spread(const Vec2d& film, double probability, MixedChain& chain) {
    std::map<std::size_t, std::array<double, 2>> pixels;
    const int length = options_.redistribution.chain_length;
    for (const std::size_t i : {0U, 1U})
      chain.run(static_cast<std::uint64_t>(length), *rng_,
                [&](const Share& share, const Rgbd&, double weight) {
                  pixels[camera_.pixel(share.film)].at(i) += weight / length;
                });
    Spread result;
    for (const auto& [pixel, of] : pixels) {
      result.kappa += 0.5 * (sqr(of[0]) + sqr(of[1])) / probability;
      result.overlap += of[0] * of[1] / probability;
    }
    const std::array<double, 2>& home = pixels[camera_.pixel(film)];
    result.home = 0.5 * (home[0] + home[1]) / probability;
    return result;
  }

  const LangevinOptions& options_;
  const Choices& choices_;
  const Camera& camera_;
  const Remainder& remainder_;
  const SplittingShare& splitting_;
  BidirectionalTracer tracer_;
  std::vector<std::unique_ptr<MixedChain>> chains_;  ///< by kind
  double light_;
  Sample sample_;
  Vec2d film_ = Vec2d::Zero();
  Rng* rng_ = nullptr;
};

/// Error times time by the pilot, up to a factor. Each two samples are of one pixel.
double cost_of(const std::vector<Sample>& samples, const ChainPlan& plan, std::size_t kind,
               double sample_cost, double chain_length) {
  const auto count = static_cast<double>(samples.size());
  const double tau = plan.threshold;
  double left = 0.0;
  for (const Sample& sample : samples) {
    for (const Bright& bright : sample.own) left += bright.left(tau);
    for (const Bright& bright : sample.splat) left += bright.left(tau);
  }
  const double deposit = deposit_for(left / count, plan.mutations_per_sample);
  const double light = deposit * chain_length;
  double noise = 0.0;
  // Sums of r r' over two remainders of one sample and of 2 r S, which meet by chance: they take
  // the means of kappa' and p_0, for few starts are followed.
  double met = 0.0;
  double met_kept = 0.0;
  Spread mean{};
  const auto add_chains = [&](const Bright& bright, double others, double kept, double weight) {
    const double r = bright.left(tau);
    const Spread& spread = bright.spread.at(kind);
    noise += weight * r * (light * spread.kappa + std::max(0.0, r - light) * spread.overlap);
    met += weight * r * others;
    met_kept += weight * 2.0 * r * kept;
    mean.overlap += r * spread.overlap;
    mean.home += r * spread.home;
  };
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& sample = samples[i];
    const Sample& other = samples[i ^ 1U];
    // A pixel is bright if both are; then m is not what its noise is relative to.
    const double weight =
        1.0 / sqr(std::max(1.0, std::min(sample.kept(kInfinity), other.kept(kInfinity))));
    const double unlike = sample.kept(tau) - other.kept(tau);
    noise += weight * 0.5 * unlike * unlike + sample.splats2;
    const double own = sample.left(tau);
    for (const Bright& bright : sample.own)
      add_chains(bright, own - bright.left(tau), unlike, weight);
    for (const Bright& bright : sample.splat) {
      noise += sqr(bright.kept(tau));
      add_chains(bright, 0.0, bright.kept(tau), 1.0);
    }
  }
  if (left > 0.0) noise += (met * mean.overlap + met_kept * mean.home) / left;
  const double mutations = left / (count * deposit);
  const double mutation_cost =
      (1.0 - plan.perturbations) * kMutationCost + plan.perturbations * kPerturbationCost;
  return noise * (sample_cost + mutation_cost * mutations);
}

}  // namespace

ChainPlan plan_chains(const Scene& scene, const LangevinOptions& options, const Pilot& pilot,
                      const SplittingShare& splitting, std::uint64_t seed) {
  const Choices choices(scene, options.redistribution, splitting.has_some());
  const std::vector<ChainPlan> plans = choices.plans();
  if (plans.size() == 1) return plans.front();
  const Remainder remainder(scene, pilot.guide, pilot.brightness, choices.least_threshold());
  const auto run = [&](std::uint64_t first, std::uint64_t number, double light) {
    std::vector<Sample> samples(number);
    tbb::parallel_for(std::uint64_t{0}, number / kTask, [&](std::uint64_t task) {
      Sampler sampler(scene, options, choices, pilot, remainder, splitting, light);
      for (std::uint64_t i = task * kTask; i < (task + 1) * kTask; i += 2) {
        Rng rng(seed, Stream::ChainPilot, first + i);
        const Camera& camera = scene.camera();
        const Vec2d size(camera.film_width, camera.film_height);
        const Vec2d pixel = (rng.uniform2().array() * size.array()).floor();
        for (const std::uint64_t k : {i, i + 1})
          samples[k] = sampler.run((pixel + rng.uniform2()).cwiseQuotient(size), rng);
      }
    });
    return samples;
  };
  const auto whole_tasks = [](std::uint64_t number) {
    return std::max<std::uint64_t>(1, number / kTask) * kTask;
  };
  const std::uint64_t count =
      whole_tasks(static_cast<std::uint64_t>(options.redistribution.pilot) / kFewer);
  const std::uint64_t first_count = whole_tasks(count / kFewer);
  double left = 0.0;
  for (const Sample& sample : run(0, first_count, kInfinity))
    for (const std::vector<Bright>* paths : {&sample.own, &sample.splat})
      for (const Bright& bright : *paths) left += bright.left(choices.least_threshold());
  if (!(left > 0.0))
    return {options.redistribution.threshold.value_or(1.0), plans.front().perturbations,
            plans.front().mutations_per_sample};
  const std::vector<Sample> samples =
      run(first_count, count, left / static_cast<double>(first_count) / kStarts);
  std::vector<double> costs(plans.size());
  tbb::parallel_for(std::size_t{0}, plans.size(), [&](std::size_t i) {
    costs[i] = cost_of(samples, plans[i], choices.kind(plans[i]), pilot.sample_cost,
                       options.redistribution.chain_length) *
               doubt(plans[i], choices.kind(plans[i]));
  });
  return plans[static_cast<std::size_t>(std::min_element(costs.begin(), costs.end()) -
                                        costs.begin())];
}

}  // namespace driftlight
