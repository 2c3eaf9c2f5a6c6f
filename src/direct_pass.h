// SPDX-License-Identifier: Apache-2.0
/// Direct light beside chains: paths of one and two edges, by a path tracer.
#pragma once

#include <algorithm>
#include <cstdint>

#include "driftlight/render.h"
#include "path_tracer.h"
#include "stopwatch.h"

namespace driftlight {

inline constexpr int kDirectDepth = 2;

/// Passes over the film, each of one sample a pixel, and how much of the time they are to have.
class DirectPass {
 public:
  DirectPass(const Scene& scene, int max_depth, std::uint64_t seed)
      : sums_(scene, std::min(kDirectDepth, max_depth), seed) {}

  void pass() {
    const Stopwatch watch;
    sums_.pass(passes_++);
    seconds_ += watch.seconds();
  }
  /// Sets the ratio of its time to that of the chains, given their mean luminance. With A / t_d +
  /// B / t_c the sum of the squared errors, t_d / t_c = sqrt(A / B): the ratio of the brightnesses
  /// times that of the noise of one sample, about 1 / 4 as a chain needs some ten mutations for
  /// what an independent sample gives.
  void set_share(double chain_mean) {
    ratio_ = chain_mean > 0.0 ? std::clamp(0.25 * mean() / chain_mean, 0.02, 2.0) : 2.0;
  }
  double ratio() const { return ratio_; }

  /// Mean luminance so far.
  double mean() const { return mean_luminance(sums_.image(passes_)); }
  /// Adds what it has rendered.
  void add_to(Image& image) const {
    const Image own = sums_.image(passes_);
    for (std::size_t i = 0; i < own.rgb.size(); ++i) image.rgb[i] += own.rgb[i];
  }
  void report(LangevinStatistics& statistics) const {
    statistics.direct_mean = mean();
    statistics.direct_samples_per_pixel = static_cast<double>(passes_);
    statistics.direct_seconds = seconds_;
  }
  std::uint64_t passes() const { return passes_; }
  double seconds() const { return seconds_; }

 private:
  PixelSums sums_;
  std::uint64_t passes_ = 0;
  double seconds_ = 0;
  double ratio_ = 0;
};

}  // namespace driftlight
