// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "splitting.h"

namespace driftlight {

/// Decides what splitting is worth its time for, from a pilot run of it: a function of its
/// arguments, whatever the threads. Both ways to the same remainder are unbiased, so any choice is
/// right.
///
/// Of the paths of one lobe sequence let F be what all particles of one sample of the top level
/// bring to level 0, a family, and r = (w - tau)_+ what one sample of the scene itself leaves as
/// remainder. Their means are the same, and per sample the noise of the one is E[F^2], of the other
///   E[r^2] = int q (w - tau)_+^2 = int pi_0 (w - tau)_+,
/// which the particles of level 0 know too, and far better than samples that seldom find these
/// paths. Splitting takes the sequences for which the first is far the smaller, if the noise that
/// it saves matters beside that of the samples' own share. Then it also takes those that the pilot
/// has not seen: if samples find one of them, then by a rare event that chains would spread. But
/// not where lobes are softened: a path through n narrow ones is up to 4^n times as bright at each
/// level as at the one before, so a few of the particles of the longest paths would be far too
/// bright, while samples do find such paths.
///
/// Levels that little depends on are left out: with d = log E[r^2] / E[r]^2 of the ratio r between
/// two levels, about the sum of those in between, d is at most that of halving a blur. But none of
/// those that soften lobes, as d does not show what becomes of paths through several.
///
/// Splitting's samples are as many for each sample of the scene as make the error least in a given
/// time: with variances V, v and costs C, c of the samples of the scene and of the top level, their
/// numbers are as sqrt(V / C) to sqrt(v / c), for an error as (sqrt(V C) + sqrt(v c))^2. Here V is
/// about C about 1, and v the sum of F_p^2 over pixels p, F_p what a family brings to one. The
/// particles of a sample are independent: with their deposit e, A e of v comes from each of them
/// alone, and B from what those of one sample have in common, while c = 1 + D / e. So v c is least
/// for e = sqrt(B D / A).
///
/// `brightness`, that of the prototype and its remainder, is raised by what particles find, if
/// splitting takes anything: where only they find light it was far too low, and effort is
/// spread over the film in proportion to light over it.
///
/// The levels of the prototype are `scenes`, of which those that are not needed are left out,
/// unless the options say how many there are; the prototype must not have run.
SplittingPlan plan_splitting(TemperedScenes& scenes, const Splitter& prototype,
                             const LangevinOptions& options, std::uint64_t seed,
                             BrightnessMap& brightness);

}  // namespace driftlight
