// SPDX-License-Identifier: Apache-2.0
#include "driftlight/gradient.h"

#include <cmath>

#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "driftlight/linearization.h"
#include "jacobian_rows.h"
#include "visitor_pair.h"

namespace driftlight {
namespace {

/// Jets of a path about the base point of a chart: coordinates [first, first + N) are seeded.
template <int N>
class SeededBlocks {
 public:
  using T = ceres::Jet<double, N>;

  SeededBlocks(const Chart& chart, int first) : chart_(chart), first_(first) {}

  /// d retract / d (d0, d1) at 0 are the chart's tangents.
  Vec3<T> operator()(int k) const {
    const Chart::Block& block = chart_.block(k);
    Vec3<T> v = constant<T>(block.point);
    const int column = 2 * k - first_;
    if (column < 0 || column >= N) return v;
    for (int i = 0; i < 3; ++i) {
      v[i].v[column] = block.t[i];
      v[i].v[column + 1] = block.b[i];
    }
    return v;
  }

 private:
  const Chart& chart_;
  int first_;
};

/// Jets of a path at other tangent coordinates of the chart.
template <int N>
class DisplacedBlocks {
 public:
  using T = ceres::Jet<double, N>;

  DisplacedBlocks(const Chart& chart, const Vector& delta, int first)
      : chart_(chart), delta_(delta), first_(first) {}

  Vec3<T> operator()(int k) const {
    T d0(delta_[2 * k]);
    T d1(delta_[2 * k + 1]);
    const int column = 2 * k - first_;
    if (column >= 0 && column < N) {
      d0.v[column] = 1.0;
      d1.v[column + 1] = 1.0;
    }
    return chart_.retract(k, d0, d1);
  }

 private:
  const Chart& chart_;
  const Vector& delta_;
  int first_;
};

/// Q = 1/9 sum_k w_k J_k^T J_k + floor
void set_matrix(const JacobianRows& rows, int d, Matrix& q) {
  rows.accumulate(d, q);
  q.diagonal().array() += kConstraintFloor;
}

template <int N>
void store_gradient(const ceres::Jet<double, N>& log_target, int first, Vector& gradient) {
  const int count = std::min<int>(N, static_cast<int>(gradient.size()) - first);
  gradient.segment(first, count) = -log_target.v.head(count);
}

template <int N>
void differentiate_pass(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        const DerivativeRequest& request, int first, JacobianRows& rows,
                        Vector& gradient) {
  using T = ceres::Jet<double, N>;
  const SeededBlocks<N> blocks(chart, first);
  rows.begin_pass(first);
  if (request.gradient && request.constraints) {
    using Constraints = ConstraintVisitor<T, JacobianRows>;
    VisitorPair<T, ContributionVisitor<T>, Constraints> visitor({}, Constraints(rows));
    walk<T>(scene, topology, blocks, visitor);
    store_gradient(visitor.first.log_target(), first, gradient);
  } else if (request.gradient) {
    ContributionVisitor<T> visitor;
    walk<T>(scene, topology, blocks, visitor);
    store_gradient(visitor.log_target(), first, gradient);
  } else {
    ConstraintVisitor<T, JacobianRows> visitor(rows);
    walk<T>(scene, topology, blocks, visitor);
  }
}

/// Calls pass(integral_constant<int, N>, first) for the passes that cover d coordinates.
template <class Pass>
void for_each_pass(int d, const Pass& pass) {
  if (d <= 4) {
    pass(std::integral_constant<int, 4>{}, 0);
  } else if (d <= 8) {
    pass(std::integral_constant<int, 8>{}, 0);
  } else {
    for (int first = 0; first < d; first += 8) pass(std::integral_constant<int, 8>{}, first);
  }
}

}  // namespace

bool PathDerivatives::all_finite(const DerivativeRequest& request) const {
  return (!request.gradient || gradient.allFinite()) && (!request.constraints || q.allFinite());
}

void differentiate(const Scene& scene, const PathTopology& topology, const Chart& chart,
                   const DerivativeRequest& request, PathDerivatives& result) {
  if (!request.gradient && !request.constraints) return;
  const int d = chart.dimension();
  JacobianRows rows;
  result.gradient.resize(request.gradient ? d : 0);
  for_each_pass(d, [&](auto width, int first) {
    differentiate_pass<width()>(scene, topology, chart, request, first, rows, result.gradient);
  });
  if (request.constraints) set_matrix(rows, d, result.q);
}

void constraint_matrix(const Scene& scene, const PathTopology& topology, const Chart& chart,
                       const Vector& delta, Matrix& q) {
  const int d = chart.dimension();
  JacobianRows rows;
  for_each_pass(d, [&](auto width, int first) {
    using T = ceres::Jet<double, width()>;
    const DisplacedBlocks<width()> blocks(chart, delta, first);
    rows.begin_pass(first);
    ConstraintVisitor<T, JacobianRows> visitor(rows);
    walk<T>(scene, topology, blocks, visitor);
  });
  set_matrix(rows, d, q);
}

}  // namespace driftlight
