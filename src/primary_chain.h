// SPDX-License-Identifier: Apache-2.0
/// A Metropolis chain in primary sample space.
#pragma once

#include "driftlight/film.h"
#include "driftlight/render.h"
#include "driftlight/running_mean.h"
#include "primary_deposits.h"

namespace driftlight {

/// Mutations are symmetric, so a move from u to u' is accepted with probability I(u') / I(u).
class PrimaryChain {
 public:
  /// Starts at a point that carries light.
  PrimaryChain(const PrimaryTarget& target, const PrimaryOptions& options, Film& film,
               const PrimaryPoint& start, Rng rng);

  void run(std::uint64_t mutations);
  /// Deposits what the current point has gathered since it was entered.
  void flush() { deposits_.flush(); }

  const LangevinStatistics& statistics() const { return statistics_; }
  /// I at all large steps proposed so far: independent estimates of its integral.
  const RunningMean& weights() const { return weights_; }

 private:
  PrimaryTarget target_;
  double large_step_probability_;
  PrimaryDeposits deposits_;
  Rng rng_;
  PrimaryPoint point_;
  LangevinStatistics statistics_;
  RunningMean weights_;
};

}  // namespace driftlight
