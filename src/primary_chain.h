// SPDX-License-Identifier: Apache-2.0
/// A Metropolis chain in primary sample space.
#pragma once

#include <vector>

#include "driftlight/film.h"
#include "driftlight/render.h"
#include "driftlight/running_mean.h"
#include "primary_deposits.h"

namespace driftlight {

/// Mutations are symmetric, so a move from u to u' is accepted with probability I(u') / I(u), and a
/// second one from u to v, after a small step that was refused, with
///   I(v) (1 - a(v, v + d)) / (I(u) (1 - a(u, u + d))),
/// d the first step and a its probability of acceptance (mutation_loop.h).
class PrimaryChain {
 public:
  /// Starts at a point that carries light. The options must outlive it.
  PrimaryChain(const PrimaryTarget& target, const PrimaryOptions& options, Film& film,
               const PrimaryPoint& start, Rng rng);

  void run(std::uint64_t mutations);
  /// Deposits what the current point has gathered since it was entered.
  void flush() { deposits_.flush(); }

  const LangevinStatistics& statistics() const { return statistics_; }
  /// I at all large steps proposed so far: independent estimates of its integral.
  const RunningMean& weights() const { return weights_; }

 private:
  void propose(bool large);
  /// The light of what the point shows, which is then the proposed place.
  double look();
  void take_delayed_step();

  PrimaryTarget target_;
  const PrimaryOptions& options_;
  PrimaryDeposits deposits_;
  Rng rng_;
  PrimaryPoint point_;
  std::vector<PrimarySplat> ghost_;
  LangevinStatistics statistics_;
  RunningMean weights_;
};

}  // namespace driftlight
