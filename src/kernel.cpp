// SPDX-License-Identifier: Apache-2.0
#include "driftlight/kernel.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace driftlight {
namespace {

/// c^2 of T = c L^-T ([E63] section 6).
constexpr double kC2 = 1.0 / 6.0;
constexpr double kLogTwoPi = 1.8378770664093454836;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

StepDistribution::StepDistribution(const KernelOptions& options, int dimension,
                                   const Vector* gradient)
    : dimension_(dimension), safety_(options.safety), cap_(options.time_step_cap) {
  log_det_l_ = dimension * std::log(1.0 / 3.0);
  if (gradient != nullptr) set_drift(options, *gradient, nullptr);
}

StepDistribution::StepDistribution(const KernelOptions& options, const Matrix& q,
                                   const Vector* gradient, const Vector* divergence_of_inverse)
    : StepDistribution(options, static_cast<int>(q.rows()), nullptr) {
  const Eigen::LLT<Matrix> cholesky(q);
  if (cholesky.info() == Eigen::Success && cholesky.matrixLLT().diagonal().allFinite()) {
    identity_ = false;
    l_ = cholesky.matrixLLT();
    log_det_l_ = l_.diagonal().array().log().sum();
  }
  if (gradient != nullptr)
    set_drift(options, *gradient, identity_ ? nullptr : divergence_of_inverse);
}

/// L^-1 x
Vector StepDistribution::solve_lower(const Vector& x) const {
  if (identity_) return 3.0 * x;
  return l_.triangularView<Eigen::Lower>().solve(x);
}

/// L^-T x
Vector StepDistribution::solve_upper(const Vector& x) const {
  if (identity_) return 3.0 * x;
  return l_.triangularView<Eigen::Lower>().transpose().solve(x);
}

void StepDistribution::set_drift(const KernelOptions& options, const Vector& gradient,
                                 const Vector* divergence_of_inverse) {
  a_ = -kC2 * solve_upper(solve_lower(gradient));
  if (divergence_of_inverse != nullptr && divergence_of_inverse->allFinite())
    a_ += kC2 * *divergence_of_inverse;
  const double a2 = a_.squaredNorm();
  has_drift_ = a2 > 0.0 && std::isfinite(a2);
  if (!has_drift_) return;
  const double ta2 = kC2 * solve_lower(a_).squaredNorm();
  ratio_limit_ = 2.0 * ta2 / (a2 * a2);
  const double slope = std::abs(a_.dot(gradient));
  slope_limit_ = slope > 0.0 ? options.epsilon / slope : kInfinity;
}

/// With T scaled by s: a -> s^2 a, so |T* a|^2 / |a|^4 -> s^-2 and (a, grad U) -> s^2.
double StepDistribution::time_step(double scale) const {
  double dt = 1.0 / 3.0;
  if (has_drift_) dt = std::min(dt, std::min(ratio_limit_, slope_limit_) / (scale * scale));
  return std::min(dt / safety_, cap_);
}

Vector StepDistribution::mean(double scale) const {
  if (!has_drift_) return Vector::Zero(dimension_);
  return (scale * scale * time_step(scale)) * a_;
}

Vector StepDistribution::sample(double scale, Rng& rng) const {
  Vector xi(dimension_);
  for (int i = 0; i < dimension_; ++i) xi[i] = rng.normal();
  const double size = scale * std::sqrt(2.0 * time_step(scale) * kC2);
  Vector delta = size * solve_upper(xi);
  if (has_drift_) delta += mean(scale);
  return delta;
}

double StepDistribution::log_density(const Vector& delta, double scale) const {
  const double variance = 2.0 * time_step(scale) * kC2 * scale * scale;
  Vector r = delta;
  if (has_drift_) r -= mean(scale);
  const double quadratic =
      identity_ ? r.squaredNorm() / 9.0
                : (l_.triangularView<Eigen::Lower>().transpose() * r).eval().squaredNorm();
  return log_det_l_ - 0.5 * (quadratic / variance + dimension_ * (kLogTwoPi + std::log(variance)));
}

double draw_scale(const KernelOptions& options, Rng& rng) {
  if (options.scale_decades <= 0.0) return options.scale;
  return options.scale * std::pow(10.0, options.scale_decades * (rng.uniform() - 0.5));
}

}  // namespace driftlight
