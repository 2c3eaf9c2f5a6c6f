// SPDX-License-Identifier: Apache-2.0
#include "derivatives/passes.h"
#include "driftlight/constraints.h"
#include "driftlight/linearization.h"
#include "visitor_pair.h"

namespace driftlight::bench {
namespace {

/// Sums 9 (Q - floor) = sum w J^T J, in all N columns.
template <int N>
class MatrixSink {
 public:
  MatrixSink() { sum_.setZero(); }

  void add(const ceres::Jet<double, N>& residual, double precision) {
    sum_.noalias() += (precision * residual.v) * residual.v.transpose();
  }
  void store(int d, Matrix& q) const {
    q = (1.0 / 9.0) * sum_.topLeftCorner(d, d);
    q.diagonal().array() += kConstraintFloor;
  }

 private:
  Eigen::Matrix<double, N, N, Eigen::RowMajor> sum_;
};

template <int N>
void derivatives(const Scene& scene, const PathTopology& topology, const Chart& chart,
                 PathDerivatives& result) {
  using T = ceres::Jet<double, N>;
  using Constraints = ConstraintVisitor<T, MatrixSink<N>>;
  const int d = chart.dimension();
  MatrixSink<N> sink;
  VisitorPair<T, ContributionVisitor<T>, Constraints> visitor({}, Constraints(sink));
  walk<T>(scene, topology, SeededBlocks<double, N>(chart, 0), visitor);
  result.gradient = -visitor.first.log_target().v.head(d);
  sink.store(d, result.q);
}

}  // namespace

void gradient_q_wide(const Scene& scene, const PathTopology& topology, const Chart& chart,
                     PathDerivatives& result) {
  with_width(chart.dimension(),
             [&](auto width) { derivatives<width()>(scene, topology, chart, result); });
}

}  // namespace driftlight::bench
