// SPDX-License-Identifier: Apache-2.0
#include "veach_chain.h"

#include <algorithm>
#include <utility>

#include "mutation_loop.h"

namespace driftlight {

VeachChain::VeachChain(const PathMutation& mutation, const MltOptions& options, Film& film,
                       const VertexPath& start, Rng rng)
    : mutation_(mutation),
      bidirectional_probability_(options.bidirectional_probability),
      delayed_rejection_(options.delayed_rejection),
      film_(film),
      rng_(rng) {
  paths_[0] = start;
}

void VeachChain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) {
    ++statistics_.path_length[static_cast<std::size_t>(current().edges)];
    const bool bidirectional = rng_.uniform() < bidirectional_probability_;
    if (!bidirectional && delayed_rejection_.on) {
      take_delayed_step();
      continue;
    }
    const double ratio =
        bidirectional ? propose_bidirectional()
                      : mutation_.propose(current(), proposed(), 1.0, rng_, statistics_.rejections);
    const double acceptance = std::min(1.0, ratio);
    KernelStatistics& kernel = bidirectional ? statistics_.large_step : statistics_.small_step;
    ++kernel.proposed;
    kernel.accepted += acceptance;
    if (!resolve(acceptance, proposed_) && acceptance > 0.0 && !bidirectional)
      ++statistics_.rejections.hastings;
  }
  statistics_.mutations += mutations;
}

/// Of why it fails only what is not finite is reported: the rest is about small steps.
double VeachChain::propose_bidirectional() {
  MutationDensities densities;
  Rejections rejections;
  const TraceStatus status = mutation_.bidirectional(current(), proposed(), densities, rng_);
  const double ratio =
      succeeded(status, rejections)
          ? acceptance_ratio(current().contribution().log_target,
                             proposed().contribution().log_target, densities, rejections)
          : 0.0;
  statistics_.rejections.non_finite += rejections.non_finite;
  return ratio;
}

void VeachChain::take_delayed_step() {
  const auto propose = [&](const VertexPath& x, VertexPath& y, MutationStage stage, Rng& numbers,
                           Rejections& rejections) {
    const double size = stage == MutationStage::Second ? delayed_rejection_.second_scale : 1.0;
    return mutation_.propose(x, y, size, numbers, rejections);
  };
  Rng numbers = rng_.fork();
  Rng again = numbers;
  Rejections& rejections = statistics_.rejections;
  const double first =
      std::min(1.0, propose(current(), proposed(), MutationStage::First, numbers, rejections));
  ++statistics_.small_step.proposed;
  statistics_.small_step.accepted += first;
  if (rng_.uniform() < first) {
    resolve(1.0, proposed_);
    return;
  }
  if (first > 0.0) ++rejections.hastings;
  const double acceptance = propose_second(current(), paths_[second_], proposed(), first, rng_,
                                           again, rejections, propose);
  ++statistics_.second_step.proposed;
  statistics_.second_step.accepted += acceptance;
  if (!resolve(acceptance, second_) && acceptance > 0.0) ++rejections.hastings;
}

bool VeachChain::resolve(double acceptance, std::size_t& index) {
  gathered_ += 1.0 - acceptance;
  if (rng_.uniform() < acceptance) {
    flush();
    std::swap(current_, index);
    gathered_ = acceptance;
    return true;
  }
  if (acceptance > 0.0) {
    const Contribution& value = paths_[index].contribution();
    film_.splat(value.film, value.color, acceptance);
  }
  return false;
}

void VeachChain::flush() {
  const Contribution& value = current().contribution();
  if (gathered_ > 0.0) film_.splat(value.film, value.color, gathered_);
  gathered_ = 0.0;
}

}  // namespace driftlight
