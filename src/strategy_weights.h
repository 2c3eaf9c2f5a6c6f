// SPDX-License-Identifier: Apache-2.0
/// The share of a path that each strategy gets; the formulas are those of subpath.h.
#pragma once

#include "sensor_connection.h"
#include "subpath.h"

namespace driftlight {

/// The weights of all strategies that can make a path add up to 1, at each path, by either
/// heuristic. Vertices z are of the subpath from the sensor, y of that from the light.
class StrategyWeights {
 public:
  /// Light subpaths are those of the guide, which must outlive it.
  explicit StrategyWeights(const EmissionGuide& guide) : guide_(guide) {}

  /// (0, t): the subpath arrives at the light end along -v, from p if that is at infinity, under
  /// this cosine with its normal (1 at infinity). 1 for t = 2: emitters that are seen directly are
  /// left to camera rays, which have no noise there but that of edges.
  OfHeuristics hit(const Arrival& z, int t, const LightEnd& end, const Vec3d& p, const Vec3d& v,
                   double cosine) const;
  /// (1, t): z connects to a light end drawn by sample_light_end.
  OfHeuristics emitter(const SubpathVertex& z, const LightEnd& end, const LightEdge& edge) const;
  /// (s, t) with s, t > 1: v from z to y is of unit length.
  OfHeuristics connection(const SubpathVertex& z, const SubpathVertex& y, const Vec3d& v,
                          double inverse_r2) const;
  /// (s, 1): y is seen by the sensor.
  OfHeuristics sensor(const SubpathVertex& y, const SensorConnection& seen) const;

 private:
  /// S_k of the last vertex of a subpath, for `from_beyond` = d_k and `backward` = q_k.
  static OfHeuristics others(const Arrival& x, double from_beyond, double backward) {
    return powers(from_beyond / x.density) *
           (powers(backward) * x.others + (x.previous_connects ? 1.0 : 0.0));
  }

  const EmissionGuide& guide_;
};

}  // namespace driftlight
