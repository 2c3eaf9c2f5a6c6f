// SPDX-License-Identifier: Apache-2.0
#include "splitting_pilot.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <map>

namespace driftlight {
namespace {

constexpr std::uint64_t kTask = 64;
/// Weight of the pilot's particles.
constexpr double kPilotDeposit = 4.0;
/// Noise of the remainder, over that of splitting, from which on splitting takes it: the latter's
/// sample takes about twice as long.
constexpr double kWorth = 2.0;
/// Least noise to be saved, in units of the squared brightness: that of the samples themselves is
/// about 1.
constexpr double kLeastSaving = 0.05;
/// Least deposit of a visit, in units of the brightness of a pixel's sample.
constexpr double kLeastDeposit = 0.2;

/// Sums over samples.
struct Noise {
  double families = 0;   ///< F^2
  double remainder = 0;  ///< r^2, as the particles know it
};

struct PilotRun {
  std::map<LobeSequence, Noise> noise;
  double steps = 0;  ///< of all particles
};

PilotRun run_task(Splitter splitter, const SplittingPlan& plan, double tau, std::uint64_t seed,
                  std::uint64_t first) {
  PilotRun result;
  std::map<LobeSequence, double> family;
  for (std::uint64_t i = first; i < first + kTask; ++i) {
    Rng rng(seed, Stream::SplittingPilot, i);
    const Vec2d film = rng.uniform2();
    family.clear();
    splitter.sample(film, plan, rng,
                    [&](LobeSequence sequence, const Share& share, const Rgbd&, double amount) {
                      family[sequence] += amount;
                      result.noise[sequence].remainder += amount * (share.w - tau);
                    });
    for (const auto& [sequence, sum] : family) result.noise[sequence].families += sum * sum;
  }
  for (const LevelFigures& level : splitter.take_figures())
    result.steps += static_cast<double>(level.steps.proposed);
  return result;
}

PilotRun run(const Splitter& prototype, const SplittingPlan& plan, double tau, std::uint64_t seed,
             std::uint64_t first, std::uint64_t samples) {
  std::vector<PilotRun> runs(samples / kTask);
  tbb::parallel_for(std::size_t{0}, runs.size(), [&](std::size_t i) {
    runs[i] = run_task(prototype, plan, tau, seed, first + i * kTask);
  });
  PilotRun sum;
  for (const PilotRun& part : runs) {
    sum.steps += part.steps;
    for (const auto& [sequence, noise] : part.noise) {
      sum.noise[sequence].families += noise.families;
      sum.noise[sequence].remainder += noise.remainder;
    }
  }
  return sum;
}

}  // namespace

SplittingPlan plan_splitting(const Splitter& prototype, const LangevinOptions& options,
                             std::uint64_t seed) {
  const double tau = options.redistribution.threshold;
  const std::uint64_t samples =
      std::max<std::uint64_t>(1, static_cast<std::uint64_t>(options.splitting.pilot) / kTask) *
      kTask;
  const SplittingPlan everything{.all = true, .sequences = {}, .deposit = kPilotDeposit};
  const PilotRun first = run(prototype, everything, tau, seed, 0, samples);
  SplittingPlan plan{.all = options.splitting.all, .sequences = {}, .deposit = kPilotDeposit};
  double saved = 0.0;
  for (const auto& [sequence, noise] : first.noise) {
    if (!plan.all && noise.remainder < kWorth * noise.families) continue;
    plan.sequences.push_back(sequence);
    saved += noise.remainder - noise.families;
  }
  if (!plan.all && saved < kLeastSaving * static_cast<double>(samples)) return {};
  const PilotRun second = run(prototype, plan, tau, seed, samples, samples);
  const double steps = second.steps / static_cast<double>(samples);
  plan.deposit = std::max(kLeastDeposit * options.splitting.last_steps,
                          kPilotDeposit * steps / options.redistribution.mutations_per_sample);
  return plan;
}

}  // namespace driftlight
