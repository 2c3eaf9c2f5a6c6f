// SPDX-License-Identifier: Apache-2.0
/// The light of one strategy's path as a function of StrategyNumbers, and that of all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "primary_deposits.h"
#include "primary_path.h"

namespace driftlight {

class StrategyTarget {
 public:
  /// Of paths from `min_edges` to `max_edges` edges. The guide must outlive it. Copies share
  /// nothing but references.
  StrategyTarget(const Scene& scene, const EmissionGuide& unguided, int min_edges, int max_edges);

  /// I_st of the strategy, and what it puts on the film in place of what was there; the path, if it
  /// carries light. Values that are not finite are no light, and counted.
  std::optional<PrimaryPath> operator()(const StrategyNumbers& numbers, const Strategy& strategy,
                                        PrimaryPlace& place);

  /// A path out of a bidirectional sample.
  struct Choice {
    PrimaryPath path;
    std::size_t splat;  ///< what it puts on the film
  };
  /// The sum of I_st over all strategies, and what all of them put on the film; one of their paths,
  /// drawn in proportion to I_st.
  std::optional<Choice> sample(const StrategyNumbers& numbers, Rng& rng, PrimaryPlace& place);

  const PrimaryFunction& function() const { return function_; }
  /// Whether numbers are to have a point on the lens.
  bool has_lens() const { return scene_.camera().has_lens(); }
  /// Since they were last taken.
  std::uint64_t take_non_finite() { return std::exchange(non_finite_, 0); }

 private:
  const Scene& scene_;
  BidirectionalTracer tracer_;
  PrimaryFunction function_;
  int min_edges_;
  std::uint64_t non_finite_ = 0;
};

}  // namespace driftlight
