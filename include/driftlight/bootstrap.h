// SPDX-License-Identifier: Apache-2.0
/// The bootstrap: normalization b and start paths of the chains (Veach and Guibas 1997).
#pragma once

#include <cstdint>
#include <vector>

#include "driftlight/chain.h"
#include "driftlight/path_sampler.h"

namespace driftlight {

/// Learns the sampler's table from a pilot of `count` samples, then draws `count` samples with
/// weights w = f / q: b = E[w]. Sample i comes from its own stream, so that any of them can be
/// drawn again, bit for bit. Runs in the current TBB arena; the result does not depend on its size.
class Bootstrap {
 public:
  Bootstrap(PathSampler& sampler, const Scene& scene, int count, std::uint64_t seed);

  const RunningMean& weights() const { return mean_; }
  /// n_eff / n = E[w]^2 / E[w^2]: what an independent sample is worth of one of f itself.
  double effective_fraction() const;
  /// `chains` paths drawn in proportion to their weight, by systematic resampling.
  /// Throws InputError if no sample carries light.
  std::vector<PathSampler::Sample> resample(int chains) const;

 private:
  const PathSampler& sampler_;
  std::uint64_t seed_;
  std::vector<double> weights_;
  RunningMean mean_;
};

}  // namespace driftlight
