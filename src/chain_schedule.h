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

/// Chains of `length` mutations that deposit `deposit` each; if they would be too many, then longer
/// ones, and if these are too long, mutations that deposit more.
inline ChainSchedule schedule_chains(double light, double deposit, double length, Rng& rng) {
  constexpr double kMostChains = 16;
  constexpr double kMostStretch = 16;
  const double chains = std::floor(light / (deposit * length) + rng.uniform());
  if (!(chains > kMostChains)) return {chains, length, deposit};
  const double mutations =
      std::ceil(std::min(light / (deposit * kMostChains), kMostStretch * length));
  return {kMostChains, mutations, light / (mutations * kMostChains)};
}

}  // namespace driftlight
