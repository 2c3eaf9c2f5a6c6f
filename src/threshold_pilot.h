// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pilot.h"
#include "remainder.h"
#include "splitting_share.h"

namespace driftlight {

/// The least tau that is chosen: below it chains would carry what all samples find.
inline constexpr double kLeastThreshold = 1.0;

/// tau of redistribution, from a pilot: a function of its arguments, whatever the threads. The
/// image is right for any; this one makes its error in a given time about the least.
///
/// In units of the brightness m about, a sample keeps S = sum of min(w, tau) over its paths in its
/// own pixel, and its noise there is the variance of S; light that it splats elsewhere counts by
/// its square. A remainder r is spread by chains of light e each, deposit times length, r / e of
/// them in the mean. With p_i the share of its light that a chain leaves in pixel i, its noise is
/// e^2 kappa, kappa = sum p_i^2, 1 for a chain that stays where it is; two chains from one start
/// have kappa' = sum p_i p'_i in common, and p_0 of it falls on what the sample keeps. So
///   error x time ~ (Var S + E[sum of r (e kappa + (r - e)_+ kappa' + 2 S p_0)])
///                  (1 + C mutations a sample),
/// C the cost of a mutation. Where chains mix slowly, or samples leave something in so many places
/// that the light of a chain is far more than what it starts from, a higher tau is better.
///
/// Takes a fourth of the samples of `options.redistribution.pilot`, and a sixteenth.
/// `remainder` has kLeastThreshold; what `splitting` takes does not start chains.
double choose_threshold(const Scene& scene, const LangevinOptions& options, const Pilot& pilot,
                        const Remainder& remainder, const SplittingShare& splitting,
                        std::uint64_t seed);

}  // namespace driftlight
