// SPDX-License-Identifier: Apache-2.0
/// The light of primary samples: the target of chains in primary sample space.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "bidirectional_tracer.h"
#include "driftlight/options.h"
#include "primary_sample.h"

namespace driftlight {

/// A state: the numbers of each part of a bidirectional sample apart, so that a subpath that grows
/// leaves the others as they are.
struct PrimaryPoint {
  PrimarySample sensor;  ///< film coordinates first
  PrimarySample light;
  PrimarySample connection;

  /// A point drawn at random, as sample `index` of a purpose.
  PrimaryPoint(const PrimaryOptions& options, std::uint64_t seed, Stream purpose,
               std::uint64_t index);

  /// Does something to all of its numbers.
  template <class Action>
  void each(const Action& action) {
    for (PrimarySample* part : {&sensor, &light, &connection}) action(*part);
  }
};

/// Light at a film point.
struct PrimarySplat {
  Vec2d film;
  Rgbd color;        ///< of luminance 1
  double luminance;  ///< positive and finite
};

/// I = sum of the luminances of what a bidirectional sample finds, of paths from `min_edges` to
/// `max_edges` edges, as a function of its numbers (Kelemen et al. 2002, with bidirectional path
/// tracing). Its integral over them is that of the path contribution over the film.
class PrimaryTarget {
 public:
  /// The guide must outlive it. Copies share nothing but references.
  PrimaryTarget(const Scene& scene, const EmissionGuide& unguided, int min_edges, int max_edges);

  /// I; what the point puts on the film, in place of what `splats` held. Values that are not finite
  /// are no light, and counted.
  double operator()(PrimaryPoint& point, std::vector<PrimarySplat>& splats);

  /// Since they were last taken.
  std::uint64_t take_non_finite() { return std::exchange(non_finite_, 0); }

 private:
  BidirectionalTracer tracer_;
  int min_edges_;
  std::uint64_t non_finite_ = 0;
};

}  // namespace driftlight
