// SPDX-License-Identifier: Apache-2.0
/// The Jacobian of all residuals of a path (constraints.h), from Jets.
#pragma once

#include <cmath>

#include "driftlight/linearization.h"

namespace driftlight {

/// Rows sqrt(w) dr of all residuals, a pass of N columns at a time: a sink of ConstraintVisitor.
class JacobianRows {
 public:
  void begin_pass(int first) {
    first_ = first;
    count_ = 0;
  }
  template <int N>
  void add(const ceres::Jet<double, N>& residual, double precision) {
    rows_.row(count_++).template segment<N>(first_) = std::sqrt(precision) * residual.v.transpose();
  }

  /// q = 1/9 sum_k w_k J_k^T J_k over d columns, all of which passes have covered. (d x d)
  void accumulate(int d, Matrix& q) const {
    if (d <= 4)
      accumulate_within<4>(d, q);
    else if (d <= 8)
      accumulate_within<8>(d, q);
    else if (d <= 16)
      accumulate_within<16>(d, q);
    else
      accumulate_within<kMaxDimension>(d, q);
  }

 private:
  /// Computed in W >= d columns so that all loops have fixed bounds.
  template <int W>
  void accumulate_within(int d, Matrix& q) const {
    Eigen::Matrix<double, W, W, Eigen::RowMajor> sum;
    sum.setZero();
    for (int i = 0; i < count_; ++i) {
      const auto row = rows_.row(i).template head<W>();
      sum.noalias() += row.transpose() * row;
    }
    q = (1.0 / 9.0) * sum.topLeftCorner(d, d);
  }

  // Uninitialised: each pass writes its columns of every row that is read.
  Eigen::Matrix<double, kMaxResiduals, kMaxDimension, Eigen::RowMajor> rows_;
  int first_ = 0;
  int count_ = 0;
};

}  // namespace driftlight
