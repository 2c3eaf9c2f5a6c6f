// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "direct_pass.h"
#include "driftlight/render.h"
#include "render_clock.h"
#include "stopwatch.h"

namespace driftlight {

/// Runs all chains in rounds, each chain the same number of mutations, and passes of direct light
/// between them, until the work or the time is used up. Either may be missing.
template <class Chain>
class ChainLoop {
 public:
  ChainLoop(std::vector<std::unique_ptr<Chain>>& chains, DirectPass* direct,
            const RenderOptions& render, RenderClock& clock, double mutations_per_pixel,
            double pixels)
      : chains_(chains),
        direct_(direct),
        render_(render),
        clock_(clock),
        pixels_(pixels),
        start_(clock.seconds()),
        mutations_(static_cast<std::uint64_t>(
            std::ceil(std::max(1.0, mutations_per_pixel * pixels /
                                        std::max(1.0, static_cast<double>(chains.size())))))),
        passes_(direct != nullptr ? static_cast<std::uint64_t>(std::ceil(
                                        std::max(1.0, direct->ratio() * mutations_per_pixel)))
                                  : 0) {}

  /// True if it was stopped early. `develop()` is the image so far.
  template <class Develop>
  bool run(const Develop& develop) {
    while (true) {
      if (render_.stop != nullptr && render_.stop->load()) return true;
      const double elapsed = clock_.seconds();
      const double fraction = render_.time ? elapsed / *render_.time : work_done();
      if (render_.progress) render_.progress({std::min(fraction, 1.0), elapsed});
      if (chains_.empty() || done_ > 0) {
        clock_.reach(fraction, mutations_per_pixel(), develop);
        if (fraction >= 1.0) return false;
      }
      if (direct_is_due(elapsed - start_))
        direct_->pass();
      else
        round(elapsed);
    }
  }

 private:
  double work_done() const {
    const double chains =
        chains_.empty() ? 1.0 : static_cast<double>(done_) / static_cast<double>(mutations_);
    if (direct_ == nullptr) return chains;
    return std::min(chains, static_cast<double>(direct_->passes()) / static_cast<double>(passes_));
  }

  double mutations_per_pixel() const {
    return static_cast<double>(done_) * static_cast<double>(chains_.size()) / pixels_;
  }

  bool direct_is_due(double elapsed) const {
    if (direct_ == nullptr) return false;
    if (chains_.empty()) return true;
    if (!render_.time) return direct_->passes() < passes_;
    return direct_->seconds() < direct_->ratio() / (1.0 + direct_->ratio()) * elapsed;
  }

  void round(double elapsed) {
    const Stopwatch watch;
    std::uint64_t mutations = next_round(elapsed);
    if (!render_.time) mutations = std::min(mutations, before_snapshot());
    tbb::parallel_for(std::size_t{0}, chains_.size(),
                      [&](std::size_t i) { chains_[i]->run(mutations); });
    done_ += mutations;
    seconds_ += watch.seconds();
  }

  /// Mutations up to the next snapshot: where it is taken must not depend on the machine's speed.
  std::uint64_t before_snapshot() const {
    const double there = std::ceil(clock_.next_snapshot() * static_cast<double>(mutations_));
    return std::max(done_ + 1, static_cast<std::uint64_t>(there)) - done_;
  }

  /// Mutations that take about a tenth of a second, or what is left of the time.
  std::uint64_t next_round(double elapsed) const {
    if (done_ == 0) return 16;
    double seconds = 0.1;
    if (render_.time) seconds = std::min(seconds, *render_.time - elapsed);
    const double rate = static_cast<double>(done_) / std::max(seconds_, 1e-6);
    return static_cast<std::uint64_t>(
        std::clamp(rate * seconds, 1.0, 16.0 * static_cast<double>(done_)));
  }

  std::vector<std::unique_ptr<Chain>>& chains_;
  DirectPass* direct_;
  const RenderOptions& render_;
  RenderClock& clock_;
  double pixels_;
  double start_;             ///< on the clock
  std::uint64_t mutations_;  ///< of each chain, if no time is given
  std::uint64_t passes_;     ///< of direct light, if no time is given
  std::uint64_t done_ = 0;
  double seconds_ = 0;
};

}  // namespace driftlight
