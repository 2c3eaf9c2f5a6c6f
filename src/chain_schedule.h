// SPDX-License-Identifier: Apache-2.0
/// How the light of one path is shared out to chains of equal deposits (Cline et al. 2005).
#pragma once

#include <algorithm>
#include <cmath>

#include "driftlight/random.h"

namespace driftlight {

/// What a Langevin step costs in bidirectional samples, and what a perturbation does.
inline constexpr double kMutationCost = 0.3;
inline constexpr double kPerturbationCost = 0.15;

/// Deposit of a mutation where samples leave so much light in the mean, in units of the brightness
/// about, for at most so many mutations a sample. Where they leave little more mutations no longer
/// pay.
inline double deposit_for(double mean_light, double mutations_per_sample) {
  constexpr double kLittle = 0.8;
  return std::max(kLittle, mean_light) / mutations_per_sample;
}

/// `chains` of `mutations` each; every mutation deposits `deposit`. In the mean over u they deposit
/// the whole light.
struct ChainSchedule {
  double chains;
  double mutations;
  double deposit;
};

/// Chains of `length` mutations that deposit `deposit` each, or if these would be too many, more.
/// As many mutations whatever the light: chains of a start x reach y after k mutations by P^k(x,
/// y), and only what all starts bring there together is in balance, for each k.
inline ChainSchedule schedule_chains(double light, double deposit, double length, Rng& rng) {
  constexpr double kMostMutations = 25600;
  const double most = std::max(1.0, std::floor(kMostMutations / length));
  const double chains = std::floor(light / (deposit * length) + rng.uniform());
  if (!(chains > most)) return {chains, length, deposit};
  return {most, length, light / (most * length)};
}

}  // namespace driftlight
