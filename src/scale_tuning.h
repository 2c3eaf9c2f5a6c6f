// SPDX-License-Identifier: Apache-2.0
/// The scale of small steps from the acceptance that is wanted.
#pragma once

#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "driftlight/render.h"

namespace driftlight {

/// Sets `scale`, to which the small steps of the chains refer, to that at which they accept
/// `target` of them (Roberts and Rosenthal 2001, "Optimal scaling for various Metropolis-Hastings
/// algorithms": 0.23 of Brownian steps and 0.57 of Langevin ones in many dimensions). Octaves from
/// 4 down to 1/256 are tried for so many mutations of each chain; between the last two log scale is
/// linear in the acceptance. These chains are a pilot's: what it has found is fixed before those of
/// the render start. The same for any number of threads.
template <class Chain>
void tune_scale(double target, const std::vector<std::unique_ptr<Chain>>& chains, double& scale) {
  constexpr std::uint64_t kMutations = 64;
  constexpr int kLargest = 2;
  constexpr int kLeast = -8;
  KernelStatistics before;
  const auto acceptance_at = [&](int octave) {
    scale = std::ldexp(1.0, octave);
    tbb::parallel_for(std::size_t{0}, chains.size(),
                      [&](std::size_t i) { chains[i]->run(kMutations); });
    KernelStatistics sum;
    for (const auto& chain : chains) sum += chain->statistics().small_step;
    const auto proposed = static_cast<double>(sum.proposed - before.proposed);
    const double accepted = sum.accepted - before.accepted;
    before = sum;
    return proposed > 0.0 ? accepted / proposed : 0.0;
  };
  double longer = 0.0;  // the acceptance an octave up
  for (int octave = kLargest; octave >= kLeast; --octave) {
    const double acceptance = acceptance_at(octave);
    if (acceptance >= target) {
      const double up = octave < kLargest ? (acceptance - target) / (acceptance - longer) : 0.0;
      scale = std::exp2(octave + up);
      return;
    }
    longer = acceptance;
  }
}

}  // namespace driftlight
