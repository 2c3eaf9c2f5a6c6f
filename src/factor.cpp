// SPDX-License-Identifier: Apache-2.0
#include "driftlight/factor.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace driftlight {

// ---- Identity ---------------------------------------------------------------------------------

double IdentityFactor::log_det() const { return dimension_ * std::log(1.0 / 3.0); }

// ---- Cholesky ---------------------------------------------------------------------------------

std::optional<CholeskyFactor> CholeskyFactor::of(const Matrix& q) {
  const Eigen::LLT<Matrix> cholesky(q);
  if (cholesky.info() != Eigen::Success || !cholesky.matrixLLT().diagonal().allFinite())
    return std::nullopt;
  CholeskyFactor factor;
  factor.l_ = cholesky.matrixLLT();
  return factor;
}

double CholeskyFactor::log_det() const { return l_.diagonal().array().log().sum(); }

Vector CholeskyFactor::apply(const Vector& x) const {
  return l_.triangularView<Eigen::Lower>().transpose() * x;
}

Vector CholeskyFactor::solve(const Vector& x) const {
  return l_.triangularView<Eigen::Lower>().transpose().solve(x);
}

Vector CholeskyFactor::solve_transposed(const Vector& x) const {
  return l_.triangularView<Eigen::Lower>().solve(x);
}

// ---- Riccati ----------------------------------------------------------------------------------

namespace {

using Row = Eigen::Array4d;  // a row over s, in one register

double dot(const Row& a, const Row& b) { return (a * b).sum(); }

/// A symmetric matrix over s, by rows.
struct StateMatrix {
  std::array<Row, 4> rows;

  static StateMatrix zero() { return {{Row::Zero(), Row::Zero(), Row::Zero(), Row::Zero()}}; }
  double operator()(int i, int j) const { return rows[static_cast<std::size_t>(i)][j]; }
  /// += [x0; x1]^T [y0; y1]
  void add(const Row& x0, const Row& y0, const Row& x1, const Row& y1) {
    for (int i = 0; i < 4; ++i) rows[static_cast<std::size_t>(i)] += x0[i] * y0 + x1[i] * y1;
  }
};

/// (rows)^T (rows) of one stage, over (s, u).
struct StageMatrix {
  StateMatrix ss = StateMatrix::zero();
  LocalRow u0 = LocalRow::Zero();  ///< rows of u, over (s, u)
  LocalRow u1 = LocalRow::Zero();

  StageMatrix(const Linearization& path, int stage) {
    const int end = path.stages[static_cast<std::size_t>(stage)].rows_end;
    for (int k = path.rows_begin(stage); k < end; ++k) {
      const LocalRow row = path.rows.row(k);
      const Row s = row.head<4>().transpose();
      for (int i = 0; i < 4; ++i) ss.rows[static_cast<std::size_t>(i)] += row[i] * s;
      u0 += row[4] * row;
      u1 += row[5] * row;
    }
  }
};

}  // namespace

RiccatiFactor::RiccatiFactor(const Linearization& path)
    : step_count_(path.stage_count), dimension_(2 * path.block_count) {
  StateMatrix cost = StateMatrix::zero();  // P_k
  double det_product = 1;
  for (int k = step_count_ - 1; k >= 0; --k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    Step& step = steps_[static_cast<std::size_t>(k)];
    step.kind = stage.kind;
    step.has_block = stage.has_block;
    StageMatrix m(path, k);
    Row us0 = m.u0.head<4>().transpose();
    Row us1 = m.u1.head<4>().transpose();
    if (stage.kind != Stage::Kind::Terminal && k > 0) {
      step.position = {stage.position.row(0).transpose(), stage.position.row(1).transpose()};
      const auto& [a0, a1] = step.position;
      if (stage.kind == Stage::Kind::Delta)
        step.direction = {stage.direction.row(0).transpose(), stage.direction.row(1).transpose()};
      // Rows of P [A; 0] or P [A; D].
      std::array<Row, 4> pe;
      for (int i = 0; i < 4; ++i) {
        Row& row = pe[static_cast<std::size_t>(i)];
        row = cost(i, 0) * a0 + cost(i, 1) * a1;
        if (stage.kind == Stage::Kind::Delta)
          row += cost(i, 2) * step.direction.first + cost(i, 3) * step.direction.second;
      }
      m.ss.add(a0, pe[0], a1, pe[1]);
      if (stage.kind == Stage::Kind::Delta) {
        m.ss.add(step.direction.first, pe[2], step.direction.second, pe[3]);
      } else {
        us0 += pe[2];
        us1 += pe[3];
      }
    }
    if (!stage.has_block) {
      cost = m.ss;
      continue;
    }
    double a = m.u0[4] + path.floor;
    double b = m.u1[4];
    double c = m.u1[5] + path.floor;
    if (stage.kind != Stage::Kind::Terminal) {
      const int i = stage.kind == Stage::Kind::Point ? 0 : 2;  // u becomes xi or omega
      a += cost(i, i);
      b += cost(i + 1, i);
      c += cost(i + 1, i + 1);
    }
    // By pivots, as Cholesky does: the inverse of Lambda would lose the digits of tight
    // constraints.
    const double inverse_a = 1.0 / a;
    const double ratio = b * inverse_a;
    const double rest = c - b * ratio;
    if (!std::isfinite(a) || !std::isfinite(rest)) {
      status_ = Status::NonFinite;
      return;
    }
    if (!(a > 0.0 && rest > 0.0)) {
      status_ = Status::Indefinite;
      return;
    }
    step.r00 = std::sqrt(a);
    step.inverse00 = 1.0 / step.r00;
    step.r01 = b * step.inverse00;
    step.r11 = std::sqrt(rest);
    step.inverse11 = 1.0 / step.r11;
    // One logarithm for many blocks, as far as the range of the exponent allows.
    det_product *= a * rest;
    if (det_product > 1e200 || det_product < 1e-200) {
      log_det_ += 0.5 * std::log(det_product);
      det_product = 1;
    }
    if (k == 0) break;
    us1 -= ratio * us0;
    const Row scaled0 = inverse_a * us0;
    step.gain.second = (1.0 / rest) * us1;
    step.gain.first = scaled0 - ratio * step.gain.second;
    cost = m.ss;
    cost.add(us0, -scaled0, us1, -step.gain.second);
  }
  log_det_ += 0.5 * std::log(det_product);
}

Vector RiccatiFactor::apply(const Vector& x) const {
  Vector y(dimension_);
  Row s = Row::Zero();
  int block = 0;
  for (int k = 0; k < step_count_; ++k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    double u0 = 0;
    double u1 = 0;
    if (step.has_block) {
      u0 = x[2 * block];
      u1 = x[2 * block + 1];
      const double v0 = k > 0 ? u0 + dot(step.gain.first, s) : u0;
      const double v1 = k > 0 ? u1 + dot(step.gain.second, s) : u1;
      y[2 * block] = step.r00 * v0 + step.r01 * v1;
      y[2 * block + 1] = step.r11 * v1;
      ++block;
    }
    s = next_state(step, k, s, u0, u1);
  }
  return y;
}

/// The same run with u solved for: u_b = R_b^-1 x_b - K_b s.
Vector RiccatiFactor::solve(const Vector& x) const {
  Vector y(dimension_);
  Row s = Row::Zero();
  int block = 0;
  for (int k = 0; k < step_count_; ++k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    double u0 = 0;
    double u1 = 0;
    if (step.has_block) {
      u1 = x[2 * block + 1] * step.inverse11;
      u0 = (x[2 * block] - step.r01 * u1) * step.inverse00;
      if (k > 0) {
        u0 -= dot(step.gain.first, s);
        u1 -= dot(step.gain.second, s);
      }
      y[2 * block] = u0;
      y[2 * block + 1] = u1;
      ++block;
    }
    s = next_state(step, k, s, u0, u1);
  }
  return y;
}

Eigen::Array4d RiccatiFactor::next_state(const Step& step, int k, const Row& s, double u0,
                                         double u1) {
  if (step.kind == Stage::Kind::Terminal) return s;
  if (step.kind == Stage::Kind::Point) return {u0, u1, 0.0, 0.0};
  if (k == 0) return {0.0, 0.0, u0, u1};
  const double x0 = dot(step.position.first, s);
  const double x1 = dot(step.position.second, s);
  if (step.kind == Stage::Kind::Free) return {x0, x1, u0, u1};
  return {x0, x1, dot(step.direction.first, s), dot(step.direction.second, s)};
}

/// The adjoint of `solve`, run backward: with lambda the adjoint of s,
///   v = x_b + lambda_omega,  y_b = R_b^-T v,  lambda <- A^T lambda_xi - K^T v   (free; a point has
///   lambda_xi in v)
///   lambda <- A^T lambda_xi + D^T lambda_omega                                  (delta)
Vector RiccatiFactor::solve_transposed(const Vector& x) const {
  Vector y(dimension_);
  Row lambda = Row::Zero();
  int block = dimension_ / 2;
  for (int k = step_count_ - 1; k >= 0; --k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    Row back = Row::Zero();
    if (step.kind != Stage::Kind::Terminal && k > 0)
      back = lambda[0] * step.position.first + lambda[1] * step.position.second;
    if (step.kind == Stage::Kind::Delta)
      back += lambda[2] * step.direction.first + lambda[3] * step.direction.second;
    if (step.has_block) {
      --block;
      const int i = step.kind == Stage::Kind::Point ? 0 : 2;
      const double v0 = x[2 * block] + lambda[i];
      const double v1 = x[2 * block + 1] + lambda[i + 1];
      y[2 * block] = v0 * step.inverse00;
      y[2 * block + 1] = (v1 - step.r01 * y[2 * block]) * step.inverse11;
      if (k > 0) back -= v0 * step.gain.first + v1 * step.gain.second;
    }
    lambda = back;
  }
  return y;
}

FactorStatus factorise(const Linearization& path, Factor& factor) {
  if (path.has_light_side) return factor.emplace<TwoSidedFactor>(path).status();
  return factor.emplace<RiccatiFactor>(path).status();
}

}  // namespace driftlight
