// SPDX-License-Identifier: Apache-2.0
/// Which of the many short chains of redistribution have their derivatives checked.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "driftlight/contribution.h"
#include "driftlight/gradient_probe.h"

namespace driftlight {

/// Chooses starts at random and gathers what their probes found. The choice depends on the seed and
/// on the start alone, never on threads, and takes no random numbers of the render. Pass k chooses
/// in proportion to 1 / (k + 1): a short render is checked well and a long one takes little longer.
class ProbedStarts {
 public:
  /// Chains make at most so many mutations in a pass, in the mean.
  ProbedStarts(const Scene& scene, const LangevinOptions& options, double mutations_of_pass,
               std::uint64_t seed);

  /// Between passes only.
  void begin_pass(std::uint64_t index);

  /// For the chains of a start, which make so many mutations in total: about each of their states
  /// may be the first that is checked. None if the start is not chosen.
  std::optional<GradientProbe> probe(const Contribution& start, double mutations) const;
  /// Keeps what a probe has found; from any thread.
  void take(const GradientProbe& probe);

  /// In an order that does not depend on threads.
  GradientTable table() const;

 private:
  const Scene& scene_;
  const LangevinOptions& options_;
  double starts_of_pass_;
  std::uint64_t seed_;
  double chance_ = 0;  ///< of a start in this pass
  std::mutex mutex_;
  std::vector<CheckedPath> paths_;
};

}  // namespace driftlight
