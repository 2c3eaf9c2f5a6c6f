// SPDX-License-Identifier: Apache-2.0
/// Independent paths from path tracing, with their exact density: the large steps (DESIGN 1.8).
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "driftlight/contribution.h"
#include "driftlight/phase_space.h"
#include "driftlight/random.h"
#include "driftlight/running_mean.h"
#include "driftlight/warp.h"

namespace driftlight {

class RayFollower;
struct SurfaceHit;

/// How the last edge of a sampled path is found.
enum class EndStrategy : std::uint8_t { Hit, Connect };

/// Draws a path length n and a strategy from a table, then a path: v_0 uniform over the film, BSDF
/// sampling at each vertex, and either whatever the last direction hits or a connection to a drawn
/// emitter point. The density of a path is the sum over both strategies,
///   q(X) = W(v_0) prod_k p(v_k) [ c_(n,hit) p(v_last) + c_(n,connect) p_emitter ],
/// in the measure of its coordinates, with delta vertices by their probability; f / q is
/// measure-free and is the weight of the balance heuristic.
class PathSampler {
 public:
  /// All lengths up to max_depth and both strategies equally likely.
  PathSampler(const Scene& scene, int max_depth);

  struct Sample {
    PathTopology topology;
    PathCoordinates coordinates;
    int entry;  ///< of the table
  };

  int entry_count() const { return table_.size(); }
  /// Replaces the table, given the weights f / q by entry of samples from the uniform one. Nearly
  /// half of the attempts go by energy, which gives large steps that are accepted; as many by the
  /// root of the second moment, which minimises the variance of b (Neyman's allocation: what scores
  /// rarely but heavily needs more attempts than its energy asks for); a tenth is uniform, so that
  /// nothing becomes impossible.
  void learn(const std::vector<RunningMean>& weights);

  /// None if the attempt carries no light for certain.
  std::optional<Sample> sample(Rng& rng) const;

  /// log q of any path; -infinity for one that cannot be sampled.
  double log_density(const PathTopology& topology, const PathCoordinates& coordinates) const;

 private:
  std::optional<Sample> end_by_hit(Sample path, RayFollower& follower, const Bsdf* last_bsdf) const;
  std::optional<Sample> connect(Sample path, const SurfaceHit& surface, Rng& rng) const;

  const Scene& scene_;
  int max_depth_;
  DiscreteDistribution table_;
};

}  // namespace driftlight
