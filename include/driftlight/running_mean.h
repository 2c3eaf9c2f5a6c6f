// SPDX-License-Identifier: Apache-2.0
/// Means with their errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace driftlight {

/// Mean and variance of independent numbers.
struct RunningMean {
  std::uint64_t count = 0;
  double sum = 0;
  double sum_of_squares = 0;

  void add(double x) {
    ++count;
    sum += x;
    sum_of_squares += x * x;
  }
  RunningMean& operator+=(const RunningMean& other) {
    count += other.count;
    sum += other.sum;
    sum_of_squares += other.sum_of_squares;
    return *this;
  }
  double mean() const { return count > 0 ? sum / static_cast<double>(count) : 0; }
  /// Standard error of the mean; infinite for fewer than two numbers.
  double error() const {
    if (count < 2) return std::numeric_limits<double>::infinity();
    const auto n = static_cast<double>(count);
    const double variance = std::max(0.0, sum_of_squares / n - mean() * mean());
    return std::sqrt(variance / (n - 1.0));
  }
};

}  // namespace driftlight
