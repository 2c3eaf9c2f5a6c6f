// SPDX-License-Identifier: Apache-2.0
#include "primary_chain.h"

#include <algorithm>

#include "mutation_loop.h"

namespace driftlight {

PrimaryChain::PrimaryChain(const PrimaryTarget& target, const PrimaryOptions& options, Film& film,
                           const PrimaryPoint& start, Rng rng)
    : target_(target), options_(options), deposits_(film), rng_(rng), point_(start) {
  deposits_.current.target = target_(point_, deposits_.current.splats);
}

void PrimaryChain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const bool large = rng_.uniform() < options_.large_step_probability;
    if (!large && options_.delayed_rejection.on)
      take_delayed_step();
    else
      propose(large);
  }
  statistics_.mutations += mutations;
}

double PrimaryChain::look() {
  deposits_.proposed.target = target_(point_, deposits_.proposed.splats);
  statistics_.rejections.non_finite += target_.take_non_finite();
  return deposits_.proposed.target;
}

void PrimaryChain::propose(bool large) {
  point_.each([&](PrimarySample& part) { large ? part.propose_large() : part.propose_small(); });
  const double proposed = look();
  if (large) weights_.add(proposed);
  const double acceptance = std::min(1.0, proposed / deposits_.current.target);
  KernelStatistics& kernel = large ? statistics_.large_step : statistics_.small_step;
  ++kernel.proposed;
  kernel.accepted += acceptance;
  Rejections& why = statistics_.rejections;
  if (deposits_.settle(acceptance, rng_))
    point_.each([](PrimarySample& part) { part.accept(); });
  else if (!large)
    ++(acceptance > 0.0 ? why.hastings : why.missed);
}

void PrimaryChain::take_delayed_step() {
  point_.each([](PrimarySample& part) { part.propose_small(); });
  const double first = std::min(1.0, look() / deposits_.current.target);
  ++statistics_.small_step.proposed;
  statistics_.small_step.accepted += first;
  if (rng_.uniform() < first) {
    deposits_.settle(1.0, rng_);
    point_.each([](PrimarySample& part) { part.accept(); });
    return;
  }
  ++(first > 0.0 ? statistics_.rejections.hastings : statistics_.rejections.missed);
  point_.each([](PrimarySample& part) { part.propose_second(); });
  const double there = look();
  double acceptance = 0.0;
  if (there > 0.0) {
    point_.each([](PrimarySample& part) { part.show_ghost(); });
    const double ghost = std::min(1.0, target_(point_, ghost_) / there);
    target_.take_non_finite();  // it is no proposal
    acceptance = second_acceptance(there / deposits_.current.target, first, ghost);
  }
  ++statistics_.second_step.proposed;
  statistics_.second_step.accepted += acceptance;
  if (deposits_.settle(acceptance, rng_))
    point_.each([](PrimarySample& part) { part.accept_second(); });
}

}  // namespace driftlight
