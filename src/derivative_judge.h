// SPDX-License-Identifier: Apache-2.0
/// Judges derivatives by finite differences of the functions that they claim to belong to.
#pragma once

#include <functional>
#include <vector>

#include "driftlight/gradient_check.h"

namespace driftlight {

/// Values of several functions at a point.
using Values = Eigen::Array<double, Eigen::Dynamic, 1, 0, kMaxResiduals, 1>;

/// Judges the derivatives of several functions of one coordinate at 0, all at once: each in `scale`
/// = max(|derivative|, |difference|, floor), steps in widths of the coordinate.
class DerivativeJudge {
 public:
  using Functions = std::function<Values(double)>;

  DerivativeJudge(Functions functions, Values derivatives, double width, double floor,
                  double tolerance);

  std::vector<DerivativeCheck> run();

 private:
  static constexpr std::size_t kStepCount = 7;

  bool all_agree() const;
  double derivative(std::size_t i) const { return derivatives_[static_cast<Eigen::Index>(i)]; }
  double scale(double derivative, double numeric) const;
  void measure_rounding();
  void compare(std::size_t k);
  void conclude(std::size_t i);
  bool contradicted(std::size_t i, std::size_t k) const;
  void look_from_each_side(double h);
  bool is_slope_of(double side, std::size_t i) const;

  Functions f_;
  Values derivatives_;
  double width_;
  double floor_;
  double tolerance_;
  Values rounding_;  ///< of the functions
  std::vector<std::array<Derivative, kStepCount>> numerics_;
  std::vector<DerivativeCheck> checks_;
};

}  // namespace driftlight
