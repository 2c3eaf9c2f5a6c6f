// SPDX-License-Identifier: Apache-2.0
/// Independent light paths with their exact density: the large steps of the chain.
#pragma once

#include <optional>
#include <vector>

#include "driftlight/options.h"
#include "driftlight/phase_space.h"
#include "driftlight/random.h"
#include "driftlight/running_mean.h"
#include "driftlight/warp.h"

namespace driftlight {

/// Draws a strategy (n, s) from a table, then a path of n edges: its last s vertices x_n, x_{n-1},
/// .. from the light (the point on the emitter, then emission and BSDF sampling), the others from
/// the sensor (v_0 uniform over the film, then BSDF sampling), and the edge between the two ends by
/// a connection. s = 0 hits the emitter, s = 1 is next-event estimation, s = n connects to the
/// sensor (Veach 1997, ch. 10). The density of a path is the sum over all strategies that can make
/// it,
///   q(X) = sum_s c_(n,s) q_s(X),
/// in the measure of its coordinates (path_density.h); f / q is measure-free and is the weight of
/// the balance heuristic.
class PathSampler {
 public:
  /// The strategies are, of LargeSteps::Path, those with s <= 1, but not the connection of the
  /// sensor itself, equally likely; of LargeSteps::Bdpt all, those with s <= 1 making half of the
  /// attempts at least. Lengths from min_depth to max_depth edges. Paths have coordinates of
  /// `phase_space`; those without are not drawn.
  PathSampler(const Scene& scene, int max_depth, LargeSteps large_steps = LargeSteps::Path,
              int min_depth = 1, PhaseSpace phase_space = PhaseSpace::Directions);

  struct Sample {
    PathTopology topology;
    PathCoordinates coordinates;
    int entry;  ///< of the table
  };

  struct Strategy {
    int length;          ///< n
    int light_vertices;  ///< s
  };

  int entry_count() const { return static_cast<int>(strategies_.size()); }
  const Strategy& strategy(int entry) const { return strategies_[static_cast<std::size_t>(entry)]; }
  /// Replaces the table, given the weights f / q by entry of samples from the first one. Nearly
  /// half of the attempts go by energy, which gives large steps that are accepted; as many by the
  /// root of the second moment, which minimises the variance of b (Neyman's allocation: what scores
  /// rarely but heavily needs more attempts than its energy asks for); a tenth is spread as at
  /// first, so that nothing becomes impossible.
  void learn(const std::vector<RunningMean>& weights);

  /// None if the attempt carries no light for certain.
  std::optional<Sample> sample(Rng& rng) const;

  /// log q of any path; -infinity for one that cannot be sampled.
  double log_density(const PathTopology& topology, const PathCoordinates& coordinates) const;

 private:
  std::vector<double> spread(double probability) const;

  const Scene& scene_;
  PhaseSpace phase_space_;
  std::vector<Strategy> strategies_;
  std::vector<int> first_of_length_;  ///< entry of (n, 0), by n; one past the end at last
  DiscreteDistribution table_;
};

}  // namespace driftlight
