// SPDX-License-Identifier: Apache-2.0
#include "veach_chain.h"

#include <cmath>

namespace driftlight {
namespace {

/// Of a proposal of this status. What fails is counted.
double vertex_acceptance(TraceStatus status, const VertexPath& x, const VertexPath& y,
                         const MutationDensities& densities, Rejections& rejections) {
  switch (status) {
    case TraceStatus::Ok:
      break;
    case TraceStatus::Missed:
      ++rejections.missed;
      return 0.0;
    case TraceStatus::OtherLobe:
      ++rejections.other_lobe;
      return 0.0;
    case TraceStatus::Occluded:
      ++rejections.occluded;
      return 0.0;
  }
  const double from = x.contribution().log_target;
  const double to = y.contribution().log_target;
  if (!std::isfinite(to) || !std::isfinite(densities.forward) || std::isnan(densities.reverse)) {
    ++rejections.non_finite;
    return 0.0;
  }
  return std::exp(log_acceptance(from, to, densities.forward, densities.reverse));
}

}  // namespace

double perturb(const PathMutation& mutation, const VertexPath& x, VertexPath& y, Rng& rng,
               Rejections& rejections) {
  MutationDensities densities;
  const bool caustic = PathMutation::has_caustic(x) && rng.uniform() < 0.5;
  const TraceStatus status =
      caustic ? mutation.caustic(x, y, densities, rng) : mutation.from_sensor(x, y, densities, rng);
  return vertex_acceptance(status, x, y, densities, rejections);
}

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
    double acceptance = 0;
    const bool bidirectional = rng_.uniform() < bidirectional_probability_;
    if (bidirectional) {
      MutationDensities densities;
      Rejections elsewhere;  // those of small steps are reported
      const TraceStatus status = mutation_.bidirectional(x, y, densities, rng_);
      acceptance = vertex_acceptance(status, x, y, densities, elsewhere);
      statistics_.rejections.non_finite += elsewhere.non_finite;
    } else {
      acceptance = perturb(mutation_, x, y, rng_, statistics_.rejections);
    }
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
