// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "driftlight/random.h"
#include "driftlight/render.h"

namespace driftlight {

/// What chains of mutations did.
struct ChainFigures {
  KernelStatistics small_step;
  KernelStatistics second_step;
  Rejections rejections;

  ChainFigures& operator+=(const ChainFigures& other) {
    small_step += other.small_step;
    second_step += other.second_step;
    rejections += other.rejections;
    return *this;
  }
};

/// Delayed rejection of any kernel by common random numbers. Let y(x, u) be the first proposal from
/// x by the random numbers u, which do not depend on x, and a(x, u) the probability of accepting
/// it. Where it is refused, a second one z is drawn from T(z | x), whatever u was, and accepted
/// with probability
///   min(1, pi(z) T(x | z) (1 - a(z, u)) / (pi(x) T(z | x) (1 - a(x, u)))):
/// for each u the flows from x to z and from z to x are the same. Where y is x moved by u the ghost
/// y(z, u) is that of Green and Mira 2001; otherwise it needs neither a density nor an inverse.
enum class MutationStage : std::uint8_t {
  First,   ///< y(x, u)
  Second,  ///< z
  Ghost,   ///< y(z, u)
};

/// The acceptance above: `ratio` is that of pi and T, the others are a(x, u) and a(z, u).
inline double second_acceptance(double ratio, double first, double ghost) {
  return ghost < 1.0 ? std::min(1.0, ratio * ((1.0 - ghost) / (1.0 - first))) : 0.0;
}

/// Proposes z from x, whose first proposal was refused though accepted with probability `first`,
/// and the ghost of z by that proposal's numbers. Returns the probability of accepting z. `propose`
/// is as below.
template <class State, class Propose>
double propose_second(State& x, State& z, State& ghost, double first, Rng& rng, Rng& first_numbers,
                      Rejections& rejections, const Propose& propose) {
  const double ratio = propose(x, z, MutationStage::Second, rng, rejections);
  if (!(ratio > 0.0)) return 0.0;
  Rejections of_ghost;  // it is no proposal
  const double to_ghost =
      std::min(1.0, propose(z, ghost, MutationStage::Ghost, first_numbers, of_ghost));
  return second_acceptance(ratio, first, to_ghost);
}

/// How a chain runs.
struct MutationRun {
  std::uint64_t mutations;
  bool delayed_rejection;
};

/// Runs a chain from `start`, which it only looks at, in the memory of three more states. A
/// mutation is propose(x, y, stage, rng, rejections): it fills y and returns pi(y) T(x | y) /
/// (pi(x) T(y | x)), 0 where there is no such y, which it counts. Reports visit(state, weight): of
/// each mutation both states, with weights 1 - a and a; what a state gathers while the chain stays
/// there at once. Returns the last state.
template <class State, class Propose, class Visit>
State& run_mutations(State& start, std::array<State, 3>& memory, const MutationRun& run, Rng& rng,
                     ChainFigures& figures, const Propose& propose, const Visit& visit) {
  State* from = &start;
  State* to = &memory[0];
  State* second = &memory[1];
  double gathered = 0;
  const auto move = [&](State*& next, double weight) {
    if (gathered > 0.0) visit(*from, gathered);
    std::swap(from, next);
    if (next == &start) next = &memory[2];
    gathered = weight;
  };
  /// With the proposal's probability of acceptance, or else the state stays.
  const auto settle = [&](State*& next, double acceptance) {
    gathered += 1.0 - acceptance;
    if (rng.uniform() < acceptance) {
      move(next, acceptance);
    } else if (acceptance > 0.0) {
      visit(*next, acceptance);
      ++figures.rejections.hastings;
    }
  };
  const auto propose_first = [&](Rng& numbers) {
    const double acceptance =
        std::min(1.0, propose(*from, *to, MutationStage::First, numbers, figures.rejections));
    ++figures.small_step.proposed;
    figures.small_step.accepted += acceptance;
    return acceptance;
  };
  for (std::uint64_t i = 0; i < run.mutations; ++i) {
    if (!run.delayed_rejection) {
      settle(to, propose_first(rng));
      continue;
    }
    Rng numbers = rng.fork();
    Rng again = numbers;
    const double first = propose_first(numbers);
    if (rng.uniform() < first) {
      move(to, 1.0);
    } else {
      if (first > 0.0) ++figures.rejections.hastings;
      const double acceptance =
          propose_second(*from, *second, *to, first, rng, again, figures.rejections, propose);
      ++figures.second_step.proposed;
      figures.second_step.accepted += acceptance;
      settle(second, acceptance);
    }
  }
  if (gathered > 0.0) visit(*from, gathered);
  return *from;
}

}  // namespace driftlight
