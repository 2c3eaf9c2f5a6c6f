// SPDX-License-Identifier: Apache-2.0
/// The time of a render, and the snapshots on its way.
#pragma once

#include <cstddef>

#include "driftlight/render.h"
#include "stopwatch.h"

namespace driftlight {

/// Starts with the render and stands still while snapshots are taken.
class RenderClock {
 public:
  /// The options must outlive it.
  explicit RenderClock(const RenderOptions& render) : render_(render) {}

  double seconds() const { return watch_.seconds() - aside_; }

  /// The fraction of the next snapshot; 1 if there is none left.
  double next_snapshot() const {
    return next_ < render_.snapshot_at.size() ? render_.snapshot_at[next_] : 1.0;
  }

  /// Hands out the image of `develop()` if a snapshot is due. Of several that are, the last one.
  template <class Develop>
  void reach(double fraction, double work, const Develop& develop) {
    const std::size_t first = next_;
    while (next_ < render_.snapshot_at.size() && render_.snapshot_at[next_] <= fraction) ++next_;
    if (next_ == first) return;
    const double elapsed = seconds();
    const Stopwatch aside;
    render_.snapshot({.fraction = render_.snapshot_at[next_ - 1],
                      .seconds = elapsed,
                      .work = work,
                      .image = develop()});
    aside_ += aside.seconds();
  }

 private:
  const RenderOptions& render_;
  Stopwatch watch_;
  std::size_t next_ = 0;
  double aside_ = 0;
};

}  // namespace driftlight
