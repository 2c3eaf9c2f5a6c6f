// SPDX-License-Identifier: Apache-2.0
/// The target of PrimaryTarget::Strategies::One as a function of StrategyNumbers, with the path
/// that it has found.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "primary_deposits.h"
#include "primary_path.h"

namespace driftlight {

class StrategyTarget {
 public:
  /// The guide must outlive it. Copies share nothing but references.
  StrategyTarget(const Scene& scene, const EmissionGuide& unguided, int max_edges);

  /// I, and what it puts on the film in place of what was there; the path, if it carries light.
  /// Values that are not finite are no light, and counted.
  std::optional<PrimaryPath> operator()(const StrategyNumbers& numbers, PrimaryPlace& place);

  const PrimaryFunction& function() const { return function_; }
  /// Since they were last taken.
  std::uint64_t take_non_finite() { return std::exchange(non_finite_, 0); }

 private:
  const Scene& scene_;
  BidirectionalTracer tracer_;
  PrimaryFunction function_;
  std::uint64_t non_finite_ = 0;
};

}  // namespace driftlight
