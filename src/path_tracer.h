// SPDX-License-Identifier: Apache-2.0
/// The path tracer: radiance along camera rays, and averages of it by pixel.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "driftlight/image.h"
#include "driftlight/random.h"
#include "driftlight/scene.h"

namespace driftlight {

/// Next-event estimation and BSDF sampling, combined with the balance heuristic (Veach 1997). It
/// shares tracing and BSDFs with the samplers of paths, but neither the contribution template nor
/// any density of the phase spaces.
class PathTracer {
 public:
  PathTracer(const Scene& scene, int max_depth) : scene_(scene), max_depth_(max_depth) {}

  /// One estimate of the radiance at the film point, by paths of at most max_depth edges.
  Rgbd radiance(const Vec2d& film, Rng& rng) const;

 private:
  const Scene& scene_;
  int max_depth_;
};

/// Sums of samples by pixel; sample s of a pixel has its own stream.
class PixelSums {
 public:
  PixelSums(const Scene& scene, int max_depth, std::uint64_t seed);

  /// Adds one sample to each pixel, on all threads. A sample that is not finite is no light: that
  /// would be a bias, so it is counted.
  void pass(std::uint64_t index);

  /// The mean of so many passes.
  Image image(std::uint64_t passes) const;
  std::uint64_t non_finite() const { return non_finite_; }

 private:
  void add(int x, int y, std::uint64_t index);
  /// Adds the samples of a pass through the filter, in the order of their pixels.
  void spread_samples();

  struct Sample {
    Vec2d film;
    Rgbd value;
  };

  const Camera& camera_;
  FilterWeights weights_;
  PathTracer tracer_;
  std::uint64_t seed_;
  std::vector<Rgbd> sums_;
  std::vector<Sample> samples_;  ///< of this pass by pixel; none if a pixel is all the filter
  std::atomic<std::uint64_t> non_finite_{0};
};

}  // namespace driftlight
