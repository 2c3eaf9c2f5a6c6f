// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pilot.h"
#include "splitting_share.h"

namespace driftlight {

/// Share of manifold perturbations among those of chains.
inline constexpr double kManifoldsOfChains = 0.5;

/// How chains spread what samples leave. The image is right for any.
struct ChainPlan {
  double threshold;             ///< tau
  double perturbations;         ///< share of the chains' turns that are of perturbations
  double mutations_per_sample;  ///< most, in the mean
};

/// What the options leave open from a pilot, so that the error in a given time is about the least:
/// a function of its arguments, whatever the threads.
///
/// In units of the brightness m about, a sample keeps S = sum of min(w, tau) over its paths in its
/// own pixel, and its noise there is the variance of S, half the squared difference of two samples
/// of one pixel; light that it splats elsewhere counts by its square. A remainder r is spread by
/// chains of light e each, deposit times length, r / e of them in the mean. With p_i the share of
/// its light that a chain leaves in pixel i, its noise is e^2 kappa, kappa = sum p_i^2, 1 for a
/// chain that stays where it is; two chains from one start have kappa' = sum p_i p'_i in common,
/// and p_0 of it falls on what the sample keeps. So
///   error x time ~ (Var S + E[sum of r (e kappa + ((r - e)_+ + r') kappa' + 2 (S - E S) p_0)])
///                  (1 + C mutations a sample),
/// C the cost of a mutation and r' what else the sample leaves there. Noise where both samples of a
/// pixel are brighter than m counts relative to the darker one. Where chains mix slowly, or samples
/// leave something in so many places that the light of a chain is far more than what it starts
/// from, a high tau is best; where they mix fast and samples are noisy though none is bright, as
/// where light comes through an opening, a low one is, and perturbations.
///
/// Takes a fourth of the samples of `options.redistribution.pilot`, and a sixteenth. What
/// `splitting` takes does not start chains. Where it takes anything tau is at least 1, for which it
/// was planned, and chains are mixed.
ChainPlan plan_chains(const Scene& scene, const LangevinOptions& options, const Pilot& pilot,
                      const SplittingShare& splitting, std::uint64_t seed);

}  // namespace driftlight
