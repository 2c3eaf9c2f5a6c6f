// SPDX-License-Identifier: Apache-2.0
#include "driftlight/linearization.h"

namespace driftlight {

void linearize(const Scene& scene, const PathTopology& topology, const Chart& chart,
               DerivativeMethod method, const DerivativeRequest& request, Linearization& result) {
  if (method == DerivativeMethod::Jet)
    linearize_by_jets(scene, topology, chart, request, result);
  else
    linearize_by_hand(scene, topology, chart, request, result);
}

Jacobian jacobian(const Linearization& path) {
  const int d = 2 * path.block_count;
  Jacobian rows = Jacobian::Zero(path.row_count(), d);
  // d s_{k-1} / d delta
  Eigen::Matrix<double, 4, Eigen::Dynamic, 0, 4, kMaxDimension> state(4, d);
  state.setZero();
  int block = 0;
  for (int k = 0; k < path.stage_count; ++k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    const int begin = path.rows_begin(k);
    const int count = stage.rows_end - begin;
    const auto local = path.rows.middleRows(begin, count).matrix();
    if (k > 0) rows.middleRows(begin, count) = local.leftCols<4>() * state;
    if (stage.has_block) rows.block(begin, 2 * block, count, 2) += local.middleCols<2>(4);
    if (stage.kind == Stage::Kind::Terminal) break;
    auto next = state;
    next.setZero();
    if (k > 0) next.topRows<2>() = stage.position * state;
    if (stage.kind == Stage::Kind::Delta)
      next.bottomRows<2>() = stage.direction * state;
    else
      next.block<2, 2>(2, 2 * block).setIdentity();
    state = next;
    if (stage.has_block) ++block;
  }
  return rows;
}

Matrix constraint_matrix(const Linearization& path) {
  const Jacobian rows = jacobian(path);
  Matrix q = rows.transpose() * rows;
  q.diagonal().array() += kConstraintFloor;
  return q;
}

}  // namespace driftlight
