// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <mutex>

#include "driftlight/render.h"
#include "exact_sum.h"
#include "mutation_loop.h"

namespace driftlight {

/// What the chains of all threads did, whatever the order in which they say so.
class ChainCounts {
 public:
  /// Of chains from so many more starts.
  void add(const ChainFigures& figures, std::uint64_t starts) {
    small_accepted_.add(figures.small_step.accepted);
    second_accepted_.add(figures.second_step.accepted);
    const std::lock_guard lock(mutex_);
    sum_ += figures;
    starts_ += starts;
  }

  LangevinStatistics statistics() const {
    LangevinStatistics result;
    result.small_step = {sum_.small_step.proposed, small_accepted_.value()};
    result.second_step = {sum_.second_step.proposed, second_accepted_.value()};
    result.rejections = sum_.rejections;
    result.starts = starts_;
    result.mutations = sum_.small_step.proposed;
    return result;
  }

 private:
  ExactSum small_accepted_;
  ExactSum second_accepted_;
  std::mutex mutex_;
  ChainFigures sum_;
  std::uint64_t starts_ = 0;
};

}  // namespace driftlight
