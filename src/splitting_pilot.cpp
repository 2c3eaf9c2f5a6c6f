// SPDX-License-Identifier: Apache-2.0
#include "splitting_pilot.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "chain_schedule.h"

namespace driftlight {
namespace {

constexpr std::uint64_t kTask = 64;
/// Weight of the pilot's particles; and where samples are to start several of them.
constexpr double kPilotDeposit = 4.0;
constexpr double kLightDeposit = 2.0;
/// Most that two successive levels may differ: E[r^2] = 16 / 7, that of a blur to a fourth of the
/// area by (1 - q)^3, and a little more.
constexpr double kMostSpread = 0.9;
/// Noise of the remainder, over that of splitting, from which on splitting takes it. Redistribution
/// spreads a heavy sample over hundreds of mutations, and so over some ten times the pixels that a
/// family covers, and needs no second sample.
constexpr double kWorth = 20.0;
/// Least noise to be saved, in units of the squared brightness: that of the samples themselves is
/// about 1. What is saved must also outweigh the time that splitting takes of the samples.
constexpr double kLeastSaving = 0.05;
/// Least deposit of a step at the last level, below which more of them no longer pay.
constexpr double kLeastDeposit = 0.2;
/// Most deposit of a particle.
constexpr double kMostDeposit = 64.0;
/// Fewest and most samples of the top level for each of the scene.
constexpr double kFewest = 0.02;
constexpr double kMost = 8.0;
/// Families of more light, over the median, do not tell more of how bright the film is where they
/// happened to fall.
constexpr double kBrightFamily = 8.0;

/// Sums over samples.
struct Noise {
  double families = 0;   ///< F^2
  double remainder = 0;  ///< r^2, as the particles know it
};

/// What a family brings to the pixels, at one point of each.
using FamilyLight = std::vector<FilmValue>;

struct PilotRun {
  std::map<LobeSequence, Noise> noise;
  double steps = 0;   ///< of all particles
  double pixels = 0;  ///< sum of F_p^2 over the pixels p, F_p what a family brings to one
  double alone = 0;   ///< the same sum over the particles of each sample one by one
  std::vector<FamilyLight> families;
  std::vector<LevelFigures> levels;

  PilotRun& operator+=(const PilotRun& other) {
    for (const auto& [sequence, part] : other.noise) {
      noise[sequence].families += part.families;
      noise[sequence].remainder += part.remainder;
    }
    steps += other.steps;
    pixels += other.pixels;
    alone += other.alone;
    families.insert(families.end(), other.families.begin(), other.families.end());
    levels.resize(std::max(levels.size(), other.levels.size()));
    for (std::size_t k = 0; k < other.levels.size(); ++k) levels[k] += other.levels[k];
    return *this;
  }
};

/// What one brings to a pixel.
struct PixelLight {
  double amount = 0;  ///< in units of the brightness
  FilmValue light = {Vec2d::Zero(), 0.0};
};

/// A pilot's splitter with what it is to do.
struct Setup {
  const Splitter& splitter;
  const Camera& camera;
  std::uint64_t seed;
};

PilotRun run_task(const Setup& pilot, const SplittingPlan& plan, std::uint64_t first) {
  PilotRun result;
  Splitter splitter = pilot.splitter;
  std::map<LobeSequence, double> family;
  std::map<std::size_t, PixelLight> pixels;
  std::map<std::pair<int, std::size_t>, double> alone;  ///< by particle and pixel
  for (std::uint64_t i = first; i < first + kTask; ++i) {
    Rng rng(pilot.seed, Stream::SplittingPilot, i);
    const Vec2d film = rng.uniform2();
    family.clear();
    pixels.clear();
    alone.clear();
    splitter.sample(
        film, plan, rng,
        [&](LobeSequence sequence, int particle, const Share& share, const Rgbd&, double amount) {
          const std::size_t pixel = pilot.camera.pixel(share.film);
          family[sequence] += amount;
          PixelLight& at = pixels[pixel];
          at.amount += amount;
          at.light = {share.film, at.light.value + amount * share.brightness};
          alone[{particle, pixel}] += amount;
          result.noise[sequence].remainder += amount * share.excess();
        });
    for (const auto& [sequence, sum] : family) result.noise[sequence].families += sum * sum;
    if (!pixels.empty()) result.families.emplace_back();
    for (const auto& [pixel, at] : pixels) {
      result.pixels += at.amount * at.amount;
      result.families.back().push_back(at.light);
    }
    for (const auto& [place, sum] : alone) result.alone += sum * sum;
  }
  result.levels = splitter.take_figures();
  for (const LevelFigures& level : result.levels)
    result.steps += static_cast<double>(level.steps.proposed + level.second_steps.proposed);
  return result;
}

PilotRun run(const Setup& pilot, const SplittingPlan& plan, std::uint64_t first,
             std::uint64_t samples) {
  std::vector<PilotRun> runs(samples / kTask);
  tbb::parallel_for(std::size_t{0}, runs.size(),
                    [&](std::size_t i) { runs[i] = run_task(pilot, plan, first + i * kTask); });
  PilotRun sum;
  for (const PilotRun& part : runs) sum += part;
  return sum;
}

/// d of level k and the next one.
double spread(const LevelFigures& level) {
  if (!(level.ratio > 0.0)) return kInfinity;
  const auto count = static_cast<double>(level.particles);
  return std::log(count * level.squared_ratio / (level.ratio * level.ratio));
}

void leave_out_levels(const std::vector<LevelFigures>& figures, TemperedScenes& scenes) {
  const int top = scenes.top();
  if (figures.size() != static_cast<std::size_t>(top) + 1) return;
  const auto spread_of = [&](int k) { return spread(figures[static_cast<std::size_t>(k)]); };
  double sum = spread_of(top);
  for (int k = top - 1; k >= 1; --k) {
    sum += spread_of(k);
    if (sum <= kMostSpread)
      scenes.leave_out(k);
    else
      sum = spread_of(k);
  }
}

/// Noise of what samples leave that splitting by this plan would save.
double saving(const PilotRun& run, const SplittingPlan& plan) {
  double sum = 0.0;
  for (const auto& [sequence, noise] : run.noise)
    if (plan.takes(sequence)) sum += noise.remainder - noise.families;
  return sum;
}

/// All light, with that of bright families cut.
std::vector<FilmValue> without_outliers(const std::vector<FamilyLight>& families) {
  if (families.empty()) return {};
  const auto total = [](const FamilyLight& family) {
    double sum = 0.0;
    for (const FilmValue& at : family) sum += at.value;
    return sum;
  };
  std::vector<double> totals(families.size());
  std::transform(families.begin(), families.end(), totals.begin(), total);
  const auto middle = totals.begin() + static_cast<std::ptrdiff_t>(totals.size() / 2);
  std::nth_element(totals.begin(), middle, totals.end());
  const double most = kBrightFamily * *middle;
  std::vector<FilmValue> result;
  for (const FamilyLight& family : families) {
    const double share = std::min(1.0, most / total(family));
    for (const FilmValue& at : family) result.push_back({at.film, share * at.value});
  }
  return result;
}

/// Deposit and rate, from a run by the plan as it is. With v the noise of a sample of the top
/// level, c its cost and r the rate, noise times time is (1 + v / r) (1 + r c) of that of samples
/// without noise of theirs in what is left to splitting; r = sqrt(v / c) makes the least of it,
/// which is returned.
double set_effort(const PilotRun& run, double samples, int last_steps, SplittingPlan& plan) {
  const double a = run.alone / (samples * plan.deposit);
  const double b = (run.pixels - run.alone) / samples;
  // Work per deposit does not depend on it.
  const double work = kMutationCost * run.steps * plan.deposit / samples;
  const double best = a > 0.0 ? std::sqrt(b * work / a) : kMostDeposit;
  const double least = kLeastDeposit * last_steps;
  plan.deposit = std::clamp(best, least, std::max(least, kMostDeposit));
  const double noise = a * plan.deposit + b;
  const double cost = 1.0 + work / plan.deposit;
  plan.rate = std::clamp(std::sqrt(noise / cost), kFewest, kMost);
  return (1.0 + noise / plan.rate) * (1.0 + plan.rate * cost);
}

}  // namespace

SplittingPlan plan_splitting(TemperedScenes& scenes, const Splitter& prototype,
                             const LangevinOptions& options, std::uint64_t seed,
                             BrightnessMap& brightness) {
  const Setup pilot{prototype, scenes[0].camera(), seed};
  const auto tasks = static_cast<std::uint64_t>(options.splitting.pilot) / kTask;
  const std::uint64_t samples = std::max<std::uint64_t>(1, tasks) * kTask;
  const auto count = static_cast<double>(samples);
  const SplittingPlan everything{.some = true, .deposit = kPilotDeposit};
  const PilotRun first = run(pilot, everything, 0, samples);
  SplittingPlan plan = everything;
  plan.unseen = options.splitting.all || !scenes.soften_lobes();
  for (const auto& [sequence, noise] : first.noise) {
    const bool leave = !options.splitting.all && noise.remainder < kWorth * noise.families;
    (leave ? plan.left : plan.taken).push_back(sequence);
  }
  double saved = saving(first, plan);
  if (!options.splitting.all && saved < kLeastSaving * count) return {};
  const PilotRun second = run(pilot, plan, samples, samples);
  if (!options.splitting.levels && !scenes.soften_lobes()) leave_out_levels(second.levels, scenes);
  const BrightnessMap before = brightness;
  brightness.add(without_outliers(second.families), count);
  plan.deposit = kLightDeposit;
  // Twice, as a sample starts only so many particles: one of great weight hides what it costs.
  double noise = 0.0;
  for (std::uint64_t round = 2; round <= 3; ++round) {
    const PilotRun result = run(pilot, plan, round * samples, samples);
    // A few rare families may make too much of it, but hardly too little.
    saved = std::min(saved, saving(result, plan));
    noise = set_effort(result, count, options.splitting.last_steps, plan);
  }
  // Sequences that are cheap to split one by one may cost more than they save all the same.
  if (!options.splitting.all && noise > 1.0 + saved / (kWorth * count)) {
    brightness = before;
    return {};
  }
  return plan;
}

}  // namespace driftlight
