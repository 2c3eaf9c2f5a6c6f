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

using Vec4 = Eigen::Vector4d;
using Mat4 = Eigen::Matrix4d;
using Mat2 = Eigen::Matrix2d;
using LocalMatrix = Eigen::Matrix<double, kLocalWidth, kLocalWidth, Eigen::RowMajor>;

/// (rows)^T (rows) of one stage; the first six rows and columns are used.
LocalMatrix local_matrix(const Linearization& path, int stage) {
  LocalMatrix m = LocalMatrix::Zero();
  const int end = path.stages[static_cast<std::size_t>(stage)].rows_end;
  for (int i = path.rows_begin(stage); i < end; ++i) {
    const LocalRow row = path.rows.row(i);
    for (int j = 0; j < 6; ++j) m.row(j).array() += row[j] * row;
  }
  return m;
}

}  // namespace

RiccatiFactor::RiccatiFactor(const Linearization& path)
    : step_count_(path.stage_count), dimension_(2 * path.block_count) {
  Mat4 cost = Mat4::Zero();  // P_k
  for (int k = step_count_ - 1; k >= 0; --k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    Step& step = steps_[static_cast<std::size_t>(k)];
    step.kind = stage.kind;
    step.has_block = stage.has_block;
    LocalMatrix h = local_matrix(path, k);
    const bool first = k == 0;
    if (stage.kind != Stage::Kind::Terminal && !first) {
      step.position = stage.position;
      const Eigen::Matrix<double, 2, 4> xi_part = cost.topLeftCorner<2, 2>() * stage.position;
      h.topLeftCorner<4, 4>() += stage.position.transpose() * xi_part;
    }
    if (stage.kind == Stage::Kind::Delta) {
      step.direction = stage.direction;
      const Eigen::Matrix<double, 2, 4> mixed = cost.bottomLeftCorner<2, 2>() * stage.position;
      const Mat4 cross = stage.direction.transpose() * mixed;
      h.topLeftCorner<4, 4>() +=
          cross + cross.transpose() +
          stage.direction.transpose() * (cost.bottomRightCorner<2, 2>() * stage.direction);
    }
    if (!stage.has_block) {
      cost = h.topLeftCorner<4, 4>();
      continue;
    }
    double a = h(4, 4) + kConstraintFloor;
    double b = h(5, 4);
    double c = h(5, 5) + kConstraintFloor;
    if (stage.kind == Stage::Kind::Free) {
      a += cost(2, 2);
      b += cost(3, 2);
      c += cost(3, 3);
    }
    // Lambda = [a b; b c] = R^T R
    const double det = a * c - b * b;
    if (!std::isfinite(det)) {
      status_ = Status::NonFinite;
      return;
    }
    step.r00 = std::sqrt(a);
    step.r01 = b / step.r00;
    const double rest = c - step.r01 * step.r01;
    if (!(a > 0.0 && rest > 0.0)) {
      status_ = Status::Indefinite;
      return;
    }
    step.r11 = std::sqrt(rest);
    log_det_ += std::log(step.r00 * step.r11);
    if (first) return;
    Eigen::Matrix<double, 2, 4> h_us = h.block<2, 4>(4, 0);
    if (stage.kind == Stage::Kind::Free) h_us += cost.bottomLeftCorner<2, 2>() * stage.position;
    Eigen::Matrix<double, 2, 4> half;  // R^-T H_us
    half.row(0) = h_us.row(0) / step.r00;
    half.row(1) = (h_us.row(1) - step.r01 * half.row(0)) / step.r11;
    step.gain.row(1) = half.row(1) / step.r11;
    step.gain.row(0) = (half.row(0) - step.r01 * step.gain.row(1)) / step.r00;
    cost = h.topLeftCorner<4, 4>() - half.transpose() * half;
  }
}

Vector RiccatiFactor::apply(const Vector& x) const {
  Vector y(dimension_);
  Vec4 s = Vec4::Zero();
  int block = 0;
  for (int k = 0; k < step_count_; ++k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    Eigen::Vector2d u = Eigen::Vector2d::Zero();
    if (step.has_block) {
      u = x.segment<2>(2 * block);
      Eigen::Vector2d v = u;
      if (k > 0) v += step.gain * s;
      y[2 * block] = step.r00 * v[0] + step.r01 * v[1];
      y[2 * block + 1] = step.r11 * v[1];
      ++block;
    }
    if (step.kind == Stage::Kind::Terminal) break;
    if (step.kind == Stage::Kind::Delta) u = step.direction * s;
    if (k > 0) s.head<2>() = (step.position * s).eval();
    s.tail<2>() = u;
  }
  return y;
}

/// The same run with u solved for: u_b = R_b^-1 x_b - K_b s.
Vector RiccatiFactor::solve(const Vector& x) const {
  Vector y(dimension_);
  Vec4 s = Vec4::Zero();
  int block = 0;
  for (int k = 0; k < step_count_; ++k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    Eigen::Vector2d u = Eigen::Vector2d::Zero();
    if (step.has_block) {
      u[1] = x[2 * block + 1] / step.r11;
      u[0] = (x[2 * block] - step.r01 * u[1]) / step.r00;
      if (k > 0) u -= step.gain * s;
      y.segment<2>(2 * block) = u;
      ++block;
    }
    if (step.kind == Stage::Kind::Terminal) break;
    if (step.kind == Stage::Kind::Delta) u = step.direction * s;
    if (k > 0) s.head<2>() = (step.position * s).eval();
    s.tail<2>() = u;
  }
  return y;
}

/// The adjoint of `solve`, run backward: with lambda the adjoint of s,
///   v = x_b + lambda_omega,  y_b = R_b^-T v,  lambda <- A^T lambda_xi - K^T v   (free)
///   lambda <- A^T lambda_xi + D^T lambda_omega                                  (delta)
Vector RiccatiFactor::solve_transposed(const Vector& x) const {
  Vector y(dimension_);
  Vec4 lambda = Vec4::Zero();
  int block = dimension_ / 2;
  for (int k = step_count_ - 1; k >= 0; --k) {
    const Step& step = steps_[static_cast<std::size_t>(k)];
    Vec4 back = Vec4::Zero();
    if (step.kind != Stage::Kind::Terminal && k > 0)
      back = step.position.transpose() * lambda.head<2>();
    if (step.kind == Stage::Kind::Delta) back += step.direction.transpose() * lambda.tail<2>();
    if (step.has_block) {
      --block;
      const Eigen::Vector2d v = x.segment<2>(2 * block) + lambda.tail<2>();
      y[2 * block] = v[0] / step.r00;
      y[2 * block + 1] = (v[1] - step.r01 * y[2 * block]) / step.r11;
      if (k > 0) back -= step.gain.transpose() * v;
    }
    lambda = back;
  }
  return y;
}

}  // namespace driftlight
