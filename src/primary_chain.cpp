// SPDX-License-Identifier: Apache-2.0
#include "primary_chain.h"

#include <algorithm>

namespace driftlight {

PrimaryChain::PrimaryChain(const PrimaryTarget& target, const PrimaryOptions& options, Film& film,
                           const PrimaryPoint& start, Rng rng)
    : target_(target),
      large_step_probability_(options.large_step_probability),
      deposits_(film),
      rng_(rng),
      point_(start) {
  deposits_.current.target = target_(point_, deposits_.current.splats);
}

void PrimaryChain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const bool large = rng_.uniform() < large_step_probability_;
    point_.each([&](PrimarySample& part) { large ? part.propose_large() : part.propose_small(); });
    const double proposed = target_(point_, deposits_.proposed.splats);
    deposits_.proposed.target = proposed;
    statistics_.rejections.non_finite += target_.take_non_finite();
    if (large) weights_.add(proposed);
    const double acceptance = std::min(1.0, proposed / deposits_.current.target);
    KernelStatistics& kernel = large ? statistics_.large_step : statistics_.small_step;
    ++kernel.proposed;
    kernel.accepted += acceptance;
    if (deposits_.settle(acceptance, rng_)) {
      point_.each([](PrimarySample& part) { part.accept(); });
    } else {
      point_.each([](PrimarySample& part) { part.reject(); });
      Rejections& why = statistics_.rejections;
      if (!large) ++(acceptance > 0.0 ? why.hastings : why.missed);
    }
  }
  statistics_.mutations += mutations;
}

}  // namespace driftlight
