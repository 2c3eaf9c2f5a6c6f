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

namespace {

/// d s / d delta (4 x d)
using StateMap = Eigen::Matrix<double, 4, Eigen::Dynamic, 0, 4, kMaxDimension>;

/// Runs stages [begin, end) of one side; fills in their rows, and returns the state behind them.
/// `block` is the next one.
StateMap run_side(const Linearization& path, int begin, int end, const LocalColumns& columns,
                  int& block, Jacobian& rows) {
  const int d = 2 * path.block_count;
  StateMap state(4, d);  // d s_{k-1} / d delta
  state.setZero();
  for (int k = begin; k < end; ++k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    const int first = path.rows_begin(k);
    const int count = stage.rows_end - first;
    const auto local = path.rows.middleRows(first, count).matrix();
    if (k > begin) rows.middleRows(first, count) = local.middleCols<4>(columns.xi) * state;
    if (stage.has_block) rows.block(first, 2 * block, count, 2) += local.middleCols<2>(columns.u);
    if (stage.kind == Stage::Kind::Terminal) break;
    StateMap next = StateMap::Zero(4, d);
    if (stage.kind == Stage::Kind::Point) {
      next.block<2, 2>(0, 2 * block).setIdentity();
    } else {
      if (k > begin) next.topRows<2>() = stage.position * state;
      if (stage.kind == Stage::Kind::Delta)
        next.bottomRows<2>() = stage.direction * state;
      else
        next.block<2, 2>(2, 2 * block).setIdentity();
    }
    state = next;
    if (stage.has_block) ++block;
  }
  return state;
}

}  // namespace

Jacobian jacobian(const Linearization& path) {
  Jacobian rows = Jacobian::Zero(path.row_count(), 2 * path.block_count);
  int block = 0;
  if (!path.has_light_side) {
    run_side(path, 0, path.stage_count, kSensorColumns, block, rows);
    return rows;
  }
  const int last = path.stage_count - 1;
  if (last < 0) return rows;
  const StateMap sensor = run_side(path, 0, path.sensor_stages, kSensorColumns, block, rows);
  const StateMap light = run_side(path, path.sensor_stages, last, kLightColumns, block, rows);
  const int first = path.rows_begin(last);
  const int count = path.row_count() - first;
  const auto local = path.rows.middleRows(first, count).matrix();
  rows.middleRows(first, count) = local.middleCols<4>(kSensorColumns.xi) * sensor +
                                  local.middleCols<4>(kLightColumns.xi) * light;
  return rows;
}

Matrix constraint_matrix(const Linearization& path) {
  const Jacobian rows = jacobian(path);
  Matrix q = rows.transpose() * rows;
  q.diagonal().array() += path.floor;
  return q;
}

/// y = J x by a run of the stages forward, J^T y by their adjoints backward.
Vector apply_constraints(const Linearization& path, const Vector& x) {
  if (path.has_light_side) {
    const Jacobian rows = jacobian(path);
    const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxResiduals, 1> y = rows * x;
    return rows.transpose() * y + path.floor * x;
  }
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
    if (stage.kind == Stage::Kind::Point) {
      s.head<2>() = u;
      continue;
    }
    if (k > 0) s.head<2>() = (stage.position * s).eval();
    s.tail<2>() = u;
  }

  Vector y = path.floor * x;
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
      if (stage.kind == Stage::Kind::Point) y.segment<2>(2 * block) += lambda.head<2>();
    }
    lambda = back;
  }
  return y;
}

}  // namespace driftlight
