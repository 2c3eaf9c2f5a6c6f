// SPDX-License-Identifier: Apache-2.0
/// A line on the terminal that says how far the render is.
#pragma once

#include <chrono>

#include "driftlight/render.h"

namespace driftlight::cli {

/// Draws on standard error if that is a terminal; else does nothing. The line is gone at the end.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void update(const Progress& progress);

 private:
  bool shown_;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace driftlight::cli
