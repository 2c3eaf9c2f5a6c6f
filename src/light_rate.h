// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "pilot.h"

namespace driftlight {

/// What so many light subpaths a sample promise.
struct LightRate {
  double rate;
  double noise;  ///< variance of a sample, in units of the brightness around
  double cut;    ///< the same, with bright paths cut
  double cost;   ///< of a sample, over one with a light subpath
};

/// At the rate c a sample brings A + B with probability c and else A to its own pixel, A from the
/// sensor and B by way of its light subpath, and b_i to others, all of them by weights for c; so
///   E[X^2] = E[A^2] + c E[2 A B + B^2 + sum b_i^2].
/// The product of A + c B of two samples at one film point is E[X]^2 there in the mean, which is no
/// noise. Weights change no random decision. So the same samples, each with a light subpath, tell
/// the noise for all rates, whose differences are then hardly random. Costs are counted in rays and
/// connections, so that they are the same in every run.
///
/// Paths that are brighter than chains leave to samples count in two ways. Cut: as w^2 up to there
/// and linearly beyond, as the noise of short chains does; a few bright paths of the sensor's side,
/// which no rate changes, then do not make light subpaths look worthless. In full: else light that
/// only they find might become rare. A function of its arguments, whatever the threads.
std::vector<LightRate> judge_light_rates(const Scene& scene, const LangevinOptions& options,
                                         std::uint64_t seed, const Pilot& pilot);

/// Sets the rate of the pilot's guide, and what a sample then costs, as the options say or so that
/// noise times cost, whichever noise is the worse for a rate, is least (the choice of sample
/// numbers of Grittmann et al. 2022, "Efficiency-aware multiple importance sampling for
/// bidirectional rendering algorithms", for one number and the whole image).
void choose_light_rate(const Scene& scene, const LangevinOptions& options, std::uint64_t seed,
                       Pilot& pilot);

}  // namespace driftlight
