// SPDX-License-Identifier: Apache-2.0
/// Numerical derivatives that know their own error.
#pragma once

#include <array>
#include <cmath>
#include <limits>

namespace driftlight::test {

struct Derivative {
  double value = 0;
  double error = std::numeric_limits<double>::infinity();  ///< estimated, absolute
};

/// f'(0) by Ridders' method: central differences at h, h / r, h / r^2, .. extrapolated to h = 0
/// with Neville's tableau; the entry with the smallest change against its neighbours wins. (C. J.
/// F. Ridders, "Accurate computation of F'(x) and F'(x) F''(x)", Adv. Eng. Software 4, 1982.)
template <class F>
Derivative ridders(const F& f, double h) {
  constexpr int kSize = 8;
  constexpr double kRatio = 2.0;
  std::array<std::array<double, kSize>, kSize> a{};
  Derivative best;
  for (std::size_t i = 0; i < kSize; ++i, h /= kRatio) {
    a[0][i] = (f(h) - f(-h)) / (2.0 * h);
    if (i == 0) {
      best.value = a[0][0];
      continue;
    }
    double factor = kRatio * kRatio;
    for (std::size_t j = 1; j <= i; ++j, factor *= kRatio * kRatio) {
      a[j][i] = (a[j - 1][i] * factor - a[j - 1][i - 1]) / (factor - 1.0);
      const double error =
          std::max(std::abs(a[j][i] - a[j - 1][i]), std::abs(a[j][i] - a[j - 1][i - 1]));
      if (error <= best.error) best = {a[j][i], error};
    }
    // Rounding has taken over: smaller steps are worse.
    if (std::abs(a[i][i] - a[i - 1][i - 1]) >= 2.0 * best.error) break;
  }
  return best;
}

struct OneSidedSlopes {
  double left;
  double right;
};

/// Slopes of f at 0 from each side, second order: (-3 f(0) + 4 f(h) - f(2 h)) / (2 h). Where f is
/// smooth they agree to O(h^2); a kink within 2 h sets them apart.
template <class F>
OneSidedSlopes one_sided_slopes(const F& f, double h) {
  const double f0 = f(0.0);
  return {(3.0 * f0 - 4.0 * f(-h) + f(-2.0 * h)) / (2.0 * h),
          (-3.0 * f0 + 4.0 * f(h) - f(2.0 * h)) / (2.0 * h)};
}

}  // namespace driftlight::test
