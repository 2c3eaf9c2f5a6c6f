// SPDX-License-Identifier: Apache-2.0
#include "veach_chain.h"

namespace driftlight {
VeachChain::VeachChain(const PathMutation& mutation, double bidirectional_probability, Film& film,
                       const VertexPath& start, Rng rng)
    : mutation_(mutation),
      bidirectional_probability_(bidirectional_probability),
      film_(film),
      rng_(rng) {
  paths_[0] = start;
}

void VeachChain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const VertexPath& x = paths_[current_];
    VertexPath& y = paths_[1 - current_];
    ++statistics_.path_length[static_cast<std::size_t>(x.edges)];
    const bool bidirectional = rng_.uniform() < bidirectional_probability_;
    MutationDensities densities;
    const TraceStatus status = bidirectional ? mutation_.bidirectional(x, y, densities, rng_)
                                             : mutation_.perturb(x, y, densities, rng_);
    Rejections rejections;
    const double acceptance =
        succeeded(status, rejections)
            ? acceptance_of(x.contribution().log_target, y.contribution().log_target, densities,
                            rejections)
            : 0.0;
    if (bidirectional)  // of the others those of small steps are reported
      statistics_.rejections.non_finite += rejections.non_finite;
    else
      statistics_.rejections += rejections;
    KernelStatistics& kernel = bidirectional ? statistics_.large_step : statistics_.small_step;
    ++kernel.proposed;
    kernel.accepted += acceptance;
    gathered_ += 1.0 - acceptance;
    if (rng_.uniform() < acceptance) {
      flush();
      current_ = 1 - current_;
      gathered_ = acceptance;
    } else if (acceptance > 0.0) {
      film_.splat(y.contribution().film, y.contribution().color, acceptance);
      if (!bidirectional) ++statistics_.rejections.hastings;
    }
  }
  statistics_.mutations += mutations;
}

void VeachChain::flush() {
  const Contribution& value = paths_[current_].contribution();
  if (gathered_ > 0.0) film_.splat(value.film, value.color, gathered_);
  gathered_ = 0.0;
}

}  // namespace driftlight
