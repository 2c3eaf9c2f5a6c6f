// SPDX-License-Identifier: Apache-2.0
#include "driftlight/bootstrap.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <string>

#include "driftlight/error.h"
#include "systematic_resampling.h"

namespace driftlight {
namespace {

struct WeightedEntry {
  double weight = 0;
  int entry = 0;
};

/// Weights f / q of samples 0 .. count - 1 of a purpose; not finite counts as no light, as it does
/// for a large step.
std::vector<WeightedEntry> draw(const PathSampler& sampler, const Scene& scene, std::size_t count,
                                std::uint64_t seed, Stream purpose) {
  std::vector<WeightedEntry> result(count);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 256), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      Rng rng(seed, purpose, i);
      const auto sample = sampler.sample(rng);
      if (!sample) continue;
      const double log_target =
          contribution(scene, sample->topology, sample->coordinates).log_target;
      const double weight =
          std::exp(log_target - sampler.log_density(sample->topology, sample->coordinates));
      if (std::isfinite(weight)) result[i] = {weight, sample->entry};
    }
  });
  return result;
}

}  // namespace

Bootstrap::Bootstrap(PathSampler& sampler, const Scene& scene, int count, std::uint64_t seed)
    : sampler_(sampler), seed_(seed) {
  const auto samples = static_cast<std::size_t>(count);
  std::vector<RunningMean> by_entry(static_cast<std::size_t>(sampler.entry_count()));
  for (const WeightedEntry& e : draw(sampler, scene, samples, seed, Stream::Pilot))
    by_entry[static_cast<std::size_t>(e.entry)].add(e.weight);
  sampler.learn(by_entry);
  weights_.reserve(samples);
  for (const WeightedEntry& e : draw(sampler, scene, samples, seed, Stream::Bootstrap)) {
    weights_.push_back(e.weight);
    mean_.add(e.weight);
  }
}

double Bootstrap::effective_fraction() const {
  if (!(mean_.sum > 0.0)) return 0.0;
  return mean_.sum / mean_.sum_of_squares * mean_.mean();
}

std::vector<PathSampler::Sample> Bootstrap::resample(int chains) const {
  if (!(mean_.sum > 0.0))
    throw InputError("no path from the sensor to an emitter carries light (" +
                     std::to_string(weights_.size()) + " samples tried)");
  Rng rng(seed_, Stream::Resampling, 0);
  std::vector<PathSampler::Sample> result;
  result.reserve(static_cast<std::size_t>(chains));
  for (const std::size_t i : systematic_resampling(weights_, chains, rng.uniform())) {
    Rng replay(seed_, Stream::Bootstrap, i);
    result.push_back(sampler_.sample(replay).value());
  }
  return result;
}

}  // namespace driftlight
