// SPDX-License-Identifier: Apache-2.0
/// Numerical derivatives that know their own error.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace driftlight {

struct Derivative {
  double value = 0;
  double error = std::numeric_limits<double>::infinity();  ///< estimated, absolute
};

/// Ridders' extrapolation of central differences at steps h, h / 2, h / 4, .. to h = 0 with
/// Neville's tableau; the entry with the smallest change against its neighbours wins. (C. J. F.
/// Ridders, "Accurate computation of F'(x) and F'(x) F''(x)", Adv. Eng. Software 4, 1982.)
class RiddersTableau {
 public:
  static constexpr std::size_t kSize = 8;
  static constexpr double kRatio = 2.0;

  /// Takes (f(h) - f(-h)) / (2 h) of the next step. True if another one may help.
  bool add(double central_difference) {
    if (done_) return false;
    const std::size_t i = count_++;
    std::array<double, kSize> column{};
    column[0] = central_difference;
    if (i == 0) best_.value = central_difference;
    double factor = kRatio * kRatio;
    for (std::size_t j = 1; j <= i; ++j, factor *= kRatio * kRatio) {
      column[j] = (column[j - 1] * factor - last_[j - 1]) / (factor - 1.0);
      const double error =
          std::max(std::abs(column[j] - column[j - 1]), std::abs(column[j] - last_[j - 1]));
      if (error <= best_.error) {
        best_ = {column[j], error};
        best_step_ = i;
      }
    }
    // Rounding has taken over: smaller steps are worse.
    const bool worse = i > 0 && std::abs(column[i] - last_[i - 1]) >= 2.0 * best_.error;
    done_ = worse || count_ == kSize;
    last_ = column;
    return !done_;
  }
  const Derivative& best() const { return best_; }
  /// The smallest step in it is h / 2^best_step.
  std::size_t best_step() const { return best_step_; }

 private:
  std::array<double, kSize> last_{};
  std::size_t count_ = 0;
  std::size_t best_step_ = 0;
  Derivative best_;
  bool done_ = false;
};

/// f'(0) by Ridders' method from the step h down.
template <class F>
Derivative ridders(const F& f, double h) {
  RiddersTableau tableau;
  while (tableau.add((f(h) - f(-h)) / (2.0 * h))) h /= RiddersTableau::kRatio;
  return tableau.best();
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

}  // namespace driftlight
