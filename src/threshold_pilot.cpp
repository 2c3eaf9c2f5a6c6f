// SPDX-License-Identifier: Apache-2.0
#include "threshold_pilot.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "bidirectional_tracer.h"
#include "chain_schedule.h"

namespace driftlight {
namespace {

constexpr std::uint64_t kTask = 64;
/// Samples of the pilot before for each that follows chains; of these for each that first tells how
/// much samples leave.
constexpr std::uint64_t kFewer = 4;
/// Starts of chains that are followed, in the mean, over samples.
constexpr double kStarts = 1.0 / 16.0;
constexpr std::array<double, 8> kThresholds{kLeastThreshold, 2, 4, 8, 16, 64, 256, 1024};

/// A path that is brighter than the least threshold.
struct Bright {
  double roulette;
  double w;
  double tau_factor;   ///< tau of such paths over that of others
  bool starts_chains;  ///< else splitting takes what samples leave
  /// Of its chains, over the probability with which two were followed; 0 if they were not.
  double kappa = 0;
  double overlap = 0;
  double home = 0;

  double kept(double tau) const { return roulette * std::min(w, tau_factor * tau); }
  double left(double tau) const {
    return starts_chains ? roulette * std::max(0.0, w - tau_factor * tau) : 0.0;
  }
};

/// What one sample has found.
struct Sample {
  double dim = 0;      ///< sum of w in its own pixel, without the bright
  double splats2 = 0;  ///< sum of squares of what it splats, without the bright
  std::vector<Bright> own;
  std::vector<Bright> splat;
};

/// Runs samples, and follows single chains.
class Sampler {
 public:
  /// A chain is followed with probability left / light, at most 1.
  Sampler(const Scene& scene, const LangevinOptions& options, const Pilot& pilot,
          const Remainder& remainder, const SplittingShare& splitting, double light)
      : options_(options),
        camera_(scene.camera()),
        remainder_(remainder),
        splitting_(splitting),
        tracer_(scene, pilot.guide, MisHeuristic::Balance, options.max_depth),
        chain_(scene, options.kernel, remainder, nullptr),
        light_(light) {}

  Sample run(Rng& rng) {
    sample_ = {};
    film_ = rng.uniform2();
    rng_ = &rng;
    tracer_.sample(film_, rng, *this);
    return std::move(sample_);
  }

  /// The sink of the tracer.
  void add(const Rgbd& value, const FoundPath& path) {
    const double w = remainder_.weight(film_, value, path);
    if (const auto bright = bright_of(w, path))
      sample_.own.push_back(*bright);
    else if (std::isfinite(w))
      sample_.dim += path.roulette * w;
  }
  void splat(const Vec2d& film, const Rgbd& value, const FoundPath& path) {
    const double w = remainder_.weight(film, value, path);
    if (const auto bright = bright_of(w, path))
      sample_.splat.push_back(*bright);
    else if (std::isfinite(w))
      sample_.splats2 += sqr(path.roulette * w);
  }

 private:
  std::optional<Bright> bright_of(double w, const FoundPath& found) {
    const auto path = remainder_.bright_path(w, found, options_.phase_space);
    if (!path) return std::nullopt;
    Bright bright{.roulette = found.roulette,
                  .w = path->share.w,
                  .tau_factor = path->share.tau / remainder_.tau(),
                  .starts_chains = !splitting_.takes(path->topology)};
    const double probability = std::min(1.0, bright.left(kLeastThreshold) / light_);
    if (probability > 0.0 && rng_->uniform() < probability) follow(*path, probability, bright);
    return bright;
  }

  /// Two chains from the path.
  void follow(const BrightPath& path, double probability, Bright& bright) {
    std::map<std::size_t, std::array<double, 2>> pixels;
    const int length = options_.redistribution.chain_length;
    chain_.start_at(path);
    for (const std::size_t i : {0U, 1U})
      chain_.run(static_cast<std::uint64_t>(length), *rng_,
                 [&](const Share& share, const Rgbd&, double weight) {
                   pixels[camera_.pixel(share.film)].at(i) += weight / length;
                 });
    for (const auto& [pixel, of] : pixels) {
      bright.kappa += 0.5 * (sqr(of[0]) + sqr(of[1])) / probability;
      bright.overlap += of[0] * of[1] / probability;
    }
    const std::array<double, 2>& home = pixels[camera_.pixel(path.share.film)];
    bright.home = 0.5 * (home[0] + home[1]) / probability;
  }

  const LangevinOptions& options_;
  const Camera& camera_;
  const Remainder& remainder_;
  const SplittingShare& splitting_;
  BidirectionalTracer tracer_;
  RemainderChain chain_;
  double light_;
  Sample sample_;
  Vec2d film_ = Vec2d::Zero();
  Rng* rng_ = nullptr;
};

/// Error times time by the pilot, up to a factor.
double cost_of(const std::vector<Sample>& samples, double tau, double sample_cost,
               const RedistributionOptions& options) {
  const auto count = static_cast<double>(samples.size());
  double left = 0.0;
  for (const Sample& sample : samples) {
    for (const Bright& bright : sample.own) left += bright.left(tau);
    for (const Bright& bright : sample.splat) left += bright.left(tau);
  }
  const double deposit = deposit_for(left / count, options.mutations_per_sample);
  const double light = deposit * options.chain_length;
  double sum = 0.0;
  double squares = 0.0;
  double noise = 0.0;
  const auto add_chains = [&](const Bright& bright, double kept) {
    const double r = bright.left(tau);
    noise += r * (light * bright.kappa + std::max(0.0, r - light) * bright.overlap +
                  2.0 * kept * bright.home);
  };
  for (const Sample& sample : samples) {
    double own = sample.dim;
    for (const Bright& bright : sample.own) {
      own += bright.kept(tau);
    }
    for (const Bright& bright : sample.own) add_chains(bright, own);
    sum += own;
    squares += own * own;
    noise += sample.splats2;
    for (const Bright& bright : sample.splat) {
      noise += sqr(bright.kept(tau));
      add_chains(bright, bright.kept(tau));
    }
  }
  noise += squares - sum * sum / count;
  const double mutations = left / (count * deposit);
  return noise * (sample_cost + kMutationCost * mutations);
}

}  // namespace

double choose_threshold(const Scene& scene, const LangevinOptions& options, const Pilot& pilot,
                        const Remainder& remainder, const SplittingShare& splitting,
                        std::uint64_t seed) {
  const auto run = [&](std::uint64_t first, std::uint64_t number, double light) {
    std::vector<Sample> samples(number);
    tbb::parallel_for(std::uint64_t{0}, number / kTask, [&](std::uint64_t task) {
      Sampler sampler(scene, options, pilot, remainder, splitting, light);
      for (std::uint64_t i = task * kTask; i < (task + 1) * kTask; ++i) {
        Rng rng(seed, Stream::ThresholdPilot, first + i);
        samples[i] = sampler.run(rng);
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
      for (const Bright& bright : *paths) left += bright.left(kLeastThreshold);
  if (!(left > 0.0)) return kLeastThreshold;
  const std::vector<Sample> samples =
      run(first_count, count, left / static_cast<double>(first_count) / kStarts);
  return *std::min_element(kThresholds.begin(), kThresholds.end(), [&](double a, double b) {
    return cost_of(samples, a, pilot.sample_cost, options.redistribution) <
           cost_of(samples, b, pilot.sample_cost, options.redistribution);
  });
}

}  // namespace driftlight
