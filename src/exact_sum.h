// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>

namespace driftlight {

/// A sum in fixed point, to which any thread may add: it does not depend on the order. Terms are
/// rounded to 2^-20; their sum must stay below 2^43.
class ExactSum {
 public:
  void add(double x) {
    sum_.fetch_add(static_cast<std::int64_t>(std::llrint(x * kUnit)), std::memory_order_relaxed);
  }
  double value() const { return static_cast<double>(sum_.load()) / kUnit; }

 private:
  static constexpr double kUnit = 0x1p20;

  std::atomic<std::int64_t> sum_{0};
};

}  // namespace driftlight
