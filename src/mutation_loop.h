// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "driftlight/random.h"

namespace driftlight {

/// Runs a chain from `start`, which it only looks at, in the memory of two more states. A mutation
/// is propose(x, y): it fills y and returns the probability of acceptance. Reports
/// visit(state, weight): of each mutation both states, with weights 1 - a and a; what a state
/// gathers while the chain stays there at once. Returns how many proposals that might have been
/// accepted were not.
template <class State, class Propose, class Visit>
std::uint64_t run_mutations(State& start, std::array<State, 2>& memory, std::uint64_t mutations,
                            Rng& rng, const Propose& propose, const Visit& visit) {
  State* from = &start;
  State* to = memory.data();
  double gathered = 0;
  std::uint64_t refused = 0;
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const double acceptance = propose(*from, *to);
    gathered += 1.0 - acceptance;
    if (rng.uniform() < acceptance) {
      if (gathered > 0.0) visit(*from, gathered);
      from = to;
      to = &memory[to == memory.data() ? 1 : 0];
      gathered = acceptance;
    } else if (acceptance > 0.0) {
      visit(*to, acceptance);
      ++refused;
    }
  }
  if (gathered > 0.0) visit(*from, gathered);
  return refused;
}

}  // namespace driftlight
