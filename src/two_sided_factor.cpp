// SPDX-License-Identifier: Apache-2.0
#include "driftlight/two_sided_factor.h"

#include <cmath>

#include "driftlight/gradient.h"

namespace driftlight {
namespace {

double dot(const Eigen::Array<double, 8, 1>& gain, const Eigen::Array4d& s,
           const Eigen::Array4d& r) {
  return (gain.head<4>() * s + gain.tail<4>() * r).sum();
}

int blocks_before(const Linearization& path, int stages) {
  int count = 0;
  for (int k = 0; k < stages; ++k)
    if (path.stages[static_cast<std::size_t>(k)].has_block) ++count;
  return count;
}

}  // namespace

TwoSidedFactor::TwoSidedFactor(const Linearization& path)
    : sensor_steps_(path.sensor_stages),
      step_count_(path.stage_count - 1),
      sensor_blocks_(blocks_before(path, path.sensor_stages)),
      dimension_(2 * path.block_count) {
  Cost cost;
  cost.fill(Row::Zero());
  for (int i = path.rows_begin(step_count_); i < path.row_count(); ++i) {
    const Row row = path.rows.row(i).transpose();
    for (int j = 0; j < 8; ++j) cost[static_cast<std::size_t>(j)] += row[j] * row;
  }
  for (int k = sensor_steps_ - 1; k >= 0; --k)
    if (!eliminate(path, k, k == 0, kSensorColumns, cost)) return;
  // A cost of r: the state of the light side.
  for (std::size_t j = 0; j < 4; ++j) {
    cost[j].head<4>() = cost[j + 4].tail<4>();
    cost[j].tail<4>().setZero();
    cost[j + 4].setZero();
  }
  for (int k = step_count_ - 1; k >= sensor_steps_; --k)
    if (!eliminate(path, k, k == sensor_steps_, kLightColumns, cost)) return;
}

/// Stage k: P_{k-1} from P_k. False if that fails.
bool TwoSidedFactor::eliminate(const Linearization& path, int k, bool first,
                               const LocalColumns& columns, Cost& cost) {
  const Stage& stage = path.stages[static_cast<std::size_t>(k)];
  Step& step = steps_[static_cast<std::size_t>(k)];
  step.kind = stage.kind;
  step.has_block = stage.has_block;
  const bool delta = stage.kind == Stage::Kind::Delta;
  if (!first) {
    step.a0.head<4>() = stage.position.row(0).transpose().array();
    step.a1.head<4>() = stage.position.row(1).transpose().array();
  }
  if (delta) {
    step.d0.head<4>() = stage.direction.row(0).transpose().array();
    step.d1.head<4>() = stage.direction.row(1).transpose().array();
  }
  // P E, but for the columns of u.
  Cost pe;
  for (std::size_t i = 0; i < 8; ++i) {
    const Row& p = cost[i];
    pe[i] = p[0] * step.a0 + p[1] * step.a1;
    if (delta) pe[i] += p[2] * step.d0 + p[3] * step.d1;
    pe[i].tail<4>() += p.tail<4>();
  }
  // P of the variables that u becomes: xi of a point, else omega.
  const std::size_t u = stage.kind == Stage::Kind::Point ? 0 : 2;
  double a = cost[u][static_cast<Eigen::Index>(u)] + path.floor;
  double b = cost[u + 1][static_cast<Eigen::Index>(u)];
  double c = cost[u + 1][static_cast<Eigen::Index>(u) + 1] + path.floor;
  Row us0 = pe[u];
  Row us1 = pe[u + 1];
  for (std::size_t j = 0; j < 4; ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    cost[j] = step.a0[i] * pe[0] + step.a1[i] * pe[1];
    if (delta) cost[j] += step.d0[i] * pe[2] + step.d1[i] * pe[3];
    cost[j + 4] = pe[j + 4];
  }
  // M
  for (int i = path.rows_begin(k); i < stage.rows_end; ++i) {
    const LocalRow row = path.rows.row(i);
    const double u0 = row[columns.u];
    const double u1 = row[columns.u + 1];
    a += u0 * u0;
    b += u0 * u1;
    c += u1 * u1;
    if (first) continue;
    const State s = row.segment<4>(columns.xi).transpose();
    us0.head<4>() += u0 * s;
    us1.head<4>() += u1 * s;
    for (std::size_t j = 0; j < 4; ++j) cost[j].head<4>() += s[static_cast<Eigen::Index>(j)] * s;
  }
  return !stage.has_block || eliminate_block(a, b, c, us0, us1, step, cost);
}

/// Takes u, of Lambda = [a b; b c], out of the cost. By pivots, as Cholesky does.
bool TwoSidedFactor::eliminate_block(double a, double b, double c, Row us0, Row us1, Step& step,
                                     Cost& cost) {
  const double inverse_a = 1.0 / a;
  const double ratio = b * inverse_a;
  const double rest = c - b * ratio;
  if (!std::isfinite(a) || !std::isfinite(rest)) {
    status_ = FactorStatus::NonFinite;
    return false;
  }
  if (!(a > 0.0 && rest > 0.0)) {
    status_ = FactorStatus::Indefinite;
    return false;
  }
  step.r00 = std::sqrt(a);
  step.inverse00 = 1.0 / step.r00;
  step.r01 = b * step.inverse00;
  step.r11 = std::sqrt(rest);
  step.inverse11 = 1.0 / step.r11;
  log_det_ += std::log(step.r00 * step.r11);
  us1 -= ratio * us0;
  const Row scaled0 = inverse_a * us0;
  step.gain1 = (1.0 / rest) * us1;
  step.gain0 = scaled0 - ratio * step.gain1;
  for (std::size_t j = 0; j < 8; ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    cost[j] -= us0[i] * scaled0 + us1[i] * step.gain1;
  }
  return true;
}

template <class Block>
TwoSidedFactor::State TwoSidedFactor::run(const Side& side, const State& other,
                                          const Block& block) const {
  State s = State::Zero();
  int b = side.blocks_end;
  for (int k = side.begin; k < side.end; ++k)
    if (steps_[static_cast<std::size_t>(k)].has_block) --b;
  for (int k = side.begin; k < side.end; ++k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    Eigen::Array2d u = Eigen::Array2d::Zero();
    if (step.has_block) {
      const Eigen::Array2d gain(dot(step.gain0, s, other), dot(step.gain1, s, other));
      u = block(step, b++, gain);
    }
    if (step.kind == Stage::Kind::Point) {
      s << u, 0.0, 0.0;
      continue;
    }
    const State before = s;
    const auto lane = [&](const Row& row) { return (row.head<4>() * before).sum(); };
    s[0] = lane(step.a0);
    s[1] = lane(step.a1);
    s[2] = step.kind == Stage::Kind::Delta ? lane(step.d0) : u[0];
    s[3] = step.kind == Stage::Kind::Delta ? lane(step.d1) : u[1];
  }
  return s;
}

Vector TwoSidedFactor::apply(const Vector& x) const {
  Vector y(dimension_);
  const auto block = [&](const Step& step, int b, const Eigen::Array2d& gain) {
    const Eigen::Array2d u(x[2 * b], x[2 * b + 1]);
    const Eigen::Array2d v = u + gain;
    y[2 * b] = step.r00 * v[0] + step.r01 * v[1];
    y[2 * b + 1] = step.r11 * v[1];
    return u;
  };
  const State light = run(light_side(), State::Zero(), block);
  run(sensor_side(), light, block);
  return y;
}

/// u_b = R_b^-1 x_b - K_b (s, r)
Vector TwoSidedFactor::solve(const Vector& x) const {
  Vector y(dimension_);
  const auto block = [&](const Step& step, int b, const Eigen::Array2d& gain) {
    const double v1 = x[2 * b + 1] * step.inverse11;
    const double v0 = (x[2 * b] - step.r01 * v1) * step.inverse00;
    const Eigen::Array2d u(v0 - gain[0], v1 - gain[1]);
    y[2 * b] = u[0];
    y[2 * b + 1] = u[1];
    return u;
  };
  const State light = run(light_side(), State::Zero(), block);
  run(sensor_side(), light, block);
  return y;
}

/// v = x_b + lambda of the variables that u becomes,  y_b = R_b^-T v,
/// lambda <- A^T lambda_xi [+ D^T lambda_omega] - K_s^T v,  and of r  - K_r^T v.
TwoSidedFactor::State TwoSidedFactor::run_back(const Side& side, State lambda, const Vector& x,
                                               Vector& y) const {
  State other = State::Zero();
  int b = side.blocks_end;
  for (int k = side.end - 1; k >= side.begin; --k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    const bool point = step.kind == Stage::Kind::Point;
    Row back = Row::Zero();
    if (!point) back = lambda[0] * step.a0 + lambda[1] * step.a1;
    if (step.kind == Stage::Kind::Delta) back += lambda[2] * step.d0 + lambda[3] * step.d1;
    if (step.has_block) {
      --b;
      const double v0 = x[2 * b] + (point ? lambda[0] : lambda[2]);
      const double v1 = x[2 * b + 1] + (point ? lambda[1] : lambda[3]);
      y[2 * b] = v0 * step.inverse00;
      y[2 * b + 1] = (v1 - step.r01 * y[2 * b]) * step.inverse11;
      back -= v0 * step.gain0 + v1 * step.gain1;
    }
    lambda = back.head<4>();
    other += back.tail<4>();
  }
  return other;
}

Vector TwoSidedFactor::solve_transposed(const Vector& x) const {
  Vector y(dimension_);
  const State light = run_back(sensor_side(), State::Zero(), x, y);
  run_back(light_side(), light, x, y);
  return y;
}

}  // namespace driftlight
