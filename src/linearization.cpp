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

/// y = J x by a run of the stages forward, J^T y by their adjoints backward.
Vector apply_constraints(const Linearization& path, const Vector& x) {
  Eigen::Array<double, kMaxResiduals, 1> residuals;
  Eigen::Vector4d s = Eigen::Vector4d::Zero();
  int block = 0;
  for (int k = 0; k < path.stage_count; ++k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    Eigen::Vector2d u = Eigen::Vector2d::Zero();
    if (stage.has_block) u = x.segment<2>(2 * block++);
    LocalRow local = LocalRow::Zero();
    local.head<4>() = s.array().transpose();
    local.segment<2>(4) = u.array().transpose();
    for (int i = path.rows_begin(k); i < stage.rows_end; ++i)
      residuals[i] = (path.rows.row(i) * local).sum();
    if (stage.kind == Stage::Kind::Terminal) break;
    if (stage.kind == Stage::Kind::Delta) u = stage.direction * s;
    if (k > 0) s.head<2>() = (stage.position * s).eval();
    s.tail<2>() = u;
  }

  Vector y = kConstraintFloor * x;
  Eigen::Vector4d lambda = Eigen::Vector4d::Zero();
  for (int k = path.stage_count - 1; k >= 0; --k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    LocalRow local = LocalRow::Zero();
    for (int i = path.rows_begin(k); i < stage.rows_end; ++i)
      local += residuals[i] * path.rows.row(i);
    Eigen::Vector4d back = local.head<4>().matrix().transpose();
    if (stage.kind != Stage::Kind::Terminal && k > 0)
      back += stage.position.transpose() * lambda.head<2>();
    if (stage.kind == Stage::Kind::Delta) back += stage.direction.transpose() * lambda.tail<2>();
    if (stage.has_block) {
      --block;
      y[2 * block] += local[4];
      y[2 * block + 1] += local[5];
      if (stage.kind == Stage::Kind::Free) y.segment<2>(2 * block) += lambda.tail<2>();
    }
    lambda = back;
  }
  return y;
}

}  // namespace driftlight
