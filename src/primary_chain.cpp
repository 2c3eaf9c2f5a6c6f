// SPDX-License-Identifier: Apache-2.0
#include "primary_chain.h"

#include <algorithm>
#include <utility>

namespace driftlight {

PrimaryChain::PrimaryChain(const PrimaryTarget& target, const PrimaryOptions& options, Film& film,
                           const PrimaryPoint& start, Rng rng)
    : target_(target),
      large_step_probability_(options.large_step_probability),
      film_(film),
      rng_(rng),
      point_(start) {
  current_.target = target_(point_, current_.splats);
}

void PrimaryChain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const bool large = rng_.uniform() < large_step_probability_;
    point_.each([&](PrimarySample& part) { large ? part.propose_large() : part.propose_small(); });
    proposed_.target = target_(point_, proposed_.splats);
    statistics_.rejections.non_finite += target_.take_non_finite();
    if (large) weights_.add(proposed_.target);
    const double acceptance = std::min(1.0, proposed_.target / current_.target);
    KernelStatistics& kernel = large ? statistics_.large_step : statistics_.small_step;
    ++kernel.proposed;
    kernel.accepted += acceptance;
    gathered_ += 1.0 - acceptance;
    if (rng_.uniform() < acceptance) {
      flush();
      point_.each([](PrimarySample& part) { part.accept(); });
      std::swap(current_, proposed_);
      gathered_ = acceptance;
    } else {
      if (acceptance > 0.0) splat(proposed_, acceptance);
      point_.each([](PrimarySample& part) { part.reject(); });
      Rejections& why = statistics_.rejections;
      if (!large) ++(acceptance > 0.0 ? why.hastings : why.missed);
    }
  }
  statistics_.mutations += mutations;
}

void PrimaryChain::flush() {
  if (gathered_ > 0.0) splat(current_, gathered_);
  gathered_ = 0.0;
}

void PrimaryChain::splat(const Place& place, double weight) {
  for (const PrimarySplat& s : place.splats)
    film_.splat(s.film, s.color, weight * s.luminance / place.target);
}

}  // namespace driftlight
