// SPDX-License-Identifier: Apache-2.0
#include "cli/progress_bar.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace driftlight::cli {

namespace {

/// [h:]mm:ss
std::string clock_text(double seconds) {
  const auto total = static_cast<long>(std::min(std::ceil(seconds), 1e9));
  const long hours = total / 3600;
  const std::string rest = fmt::format("{:02}:{:02}", total / 60 % 60, total % 60);
  return hours > 0 ? fmt::format("{}:{}", hours, rest) : rest;
}

void draw(const std::string& text) {
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace

ProgressBar::ProgressBar(bool wanted) : shown_(wanted && ::isatty(STDERR_FILENO) == 1) {}

ProgressBar::~ProgressBar() {
  if (shown_) draw("\r\033[K");
}

void ProgressBar::update(const Progress& progress) {
  const auto now = std::chrono::steady_clock::now();
  if (!shown_ || now < next_) return;
  next_ = now + std::chrono::milliseconds(100);
  constexpr int kWidth = 40;
  const double fraction = std::clamp(progress.fraction, 0.0, 1.0);
  const int filled = static_cast<int>(fraction * kWidth);
  // The left time supposes that the rest goes as fast as what is done.
  const std::string left = fraction > 0.0
                               ? clock_text(progress.elapsed * (1.0 - fraction) / fraction)
                               : std::string("--:--");
  draw(fmt::format("\r[{:=>{}}{:{}}] {:3.0f} %  {} left\033[K", "", filled, "", kWidth - filled,
                   100.0 * fraction, left));
}

}  // namespace driftlight::cli
