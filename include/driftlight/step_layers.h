// SPDX-License-Identifier: Apache-2.0
/// Where the sampler works: means over the small steps that start in each pixel.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "driftlight/image.h"
#include "driftlight/kernel.h"

namespace driftlight {

/// What a state says about the small steps that start there.
struct StepFigures {
  /// |grad U| over the tangent coordinates of the chart (radians for directions, radii of the
  /// emitter for its points), whether the drift uses it or not. The same in any basis of tangents.
  double gradient_norm = 0;
  /// log10 of the condition number of the Q that shapes the step, its largest eigenvalue over its
  /// smallest. 0 with the identity preconditioner, and where Q cannot be factorised and the
  /// identity stands in.
  double anisotropy = 0;
};

/// log10 of the condition number of Q = F^T F in d coordinates; at most 15.7, where rounding hides
/// the smallest eigenvalue.
double log_condition(const Factor& factor, int dimension);

/// `chart` is that of the state, and `step` what it draws its small steps from.
StepFigures step_figures(const Scene& scene, const PathTopology& topology, const Chart& chart,
                         DerivativeMethod method, const StepDistribution& step);

/// Five channels by pixel, over all small-step mutations whose current state lies in the pixel,
/// whether they were accepted or not:
///   gradient_norm  mean of StepFigures::gradient_norm
///   acceptance     mean probability of acceptance; 0 for a proposal that is no path
///   anisotropy     mean of StepFigures::anisotropy
///   time_step      mean dt of (E63.9)
///   mutations      their number
/// A pixel without a mutation has 0 in all channels.
///
/// Sums are integers, so that they do not depend on the order of the mutations: a value is rounded
/// to a multiple of 2^-34 times the largest that its channel can hold, and 2^29 mutations fit a
/// pixel. The largest are 2^24 for the gradient norm, 1 for acceptance and time step, and 16 for
/// the anisotropy. What is larger, or is not finite, counts as the largest; what is positive counts
/// as no less than one unit.
class StepLayers {
 public:
  StepLayers(int width, int height);

  /// Counts a mutation that starts at these film coordinates in [0, 1)^2. `figures` is null where
  /// the derivatives are not finite and there is no step: the mutation, rejected, then counts in
  /// `acceptance` and `mutations` only. Any thread may call it.
  void add(const Vec2d& film, double acceptance, const StepFigures* figures, double time_step);

  Layers develop() const;

 private:
  struct Pixel {
    std::atomic<std::int64_t> gradient_norm{0};
    std::atomic<std::int64_t> acceptance{0};
    std::atomic<std::int64_t> anisotropy{0};
    std::atomic<std::int64_t> time_step{0};
    std::atomic<std::int64_t> mutations{0};
    std::atomic<std::int64_t> steps{0};  ///< mutations with figures
  };

  int width_;
  int height_;
  std::vector<Pixel> pixels_;
};

}  // namespace driftlight
