// SPDX-License-Identifier: Apache-2.0
#include "driftlight/kernel.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace driftlight {
namespace {

/// c^2 of T = c L^-T ([E63] section 6).
constexpr double kC2 = 1.0 / 6.0;
constexpr double kLogTwoPi = 1.8378770664093454836;

}  // namespace

StepDistribution::StepDistribution(const KernelOptions& options, int dimension,
                                   const Factor& factor, const Vector* gradient,
                                   const Vector* divergence_of_inverse)
    : factor_(factor) {
  set(options, dimension, gradient, divergence_of_inverse);
}

FactorStatus StepDistribution::factorise_step(const Linearization& path, const Matrix* precision) {
  if (precision == nullptr)
    return path.stage_count > 0 ? factorise(path, factor_) : FactorStatus::Indefinite;
  if (!precision->allFinite()) return FactorStatus::NonFinite;
  const auto cholesky = CholeskyFactor::of(*precision);
  if (!cholesky) return FactorStatus::Indefinite;
  factor_ = *cholesky;
  return FactorStatus::Ok;
}

bool StepDistribution::assign(const KernelOptions& options, const Linearization& path,
                              const Matrix* precision, const Vector* divergence_of_inverse) {
  if (!path.gradient.allFinite()) return false;
  const int dimension = 2 * path.block_count;
  const FactorStatus status = factorise_step(path, precision);
  if (status == FactorStatus::NonFinite) return false;
  const bool identity = status == FactorStatus::Indefinite;
  if (identity) factor_ = IdentityFactor(dimension);
  const bool has_gradient = path.gradient.size() > 0;
  set(options, dimension, has_gradient ? &path.gradient : nullptr,
      identity ? nullptr : divergence_of_inverse);
  return true;
}

void StepDistribution::set(const KernelOptions& options, int dimension, const Vector* gradient,
                           const Vector* divergence_of_inverse) {
  dimension_ = dimension;
  safety_ = options.safety;
  cap_ = options.time_step_cap;
  log_det_ = std::visit([](const auto& f) { return f.log_det(); }, factor_);
  has_drift_ = false;
  if (gradient != nullptr) set_drift(options, *gradient, divergence_of_inverse);
}

/// With y = F^-T grad U:  T T* grad U = c^2 F^-1 y. |T* a|^2 = c^2 |F^-T a|^2.
void StepDistribution::set_drift(const KernelOptions& options, const Vector& gradient,
                                 const Vector* divergence_of_inverse) {
  std::visit([&](const auto& f) { a_ = -kC2 * f.solve(f.solve_transposed(gradient)); }, factor_);
  if (divergence_of_inverse != nullptr && divergence_of_inverse->allFinite())
    a_ += kC2 * *divergence_of_inverse;
  const double a2 = a_.squaredNorm();
  has_drift_ = a2 > 0.0 && std::isfinite(a2);
  if (!has_drift_) return;
  const double ta2 =
      kC2 *
      std::visit([&](const auto& f) { return f.solve_transposed(a_).squaredNorm(); }, factor_);
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
  Vector delta = size * std::visit([&](const auto& f) { return f.solve(xi); }, factor_);
  if (has_drift_) delta += mean(scale);
  return delta;
}

double StepDistribution::log_density(const Vector& delta, double scale) const {
  const double variance = 2.0 * time_step(scale) * kC2 * scale * scale;
  Vector r = delta;
  if (has_drift_) r -= mean(scale);
  const double quadratic =
      std::visit([&](const auto& f) { return f.apply(r).squaredNorm(); }, factor_);
  return log_det_ - 0.5 * (quadratic / variance + dimension_ * (kLogTwoPi + std::log(variance)));
}

double draw_scale(const KernelOptions& options, Rng& rng) {
  if (options.scale_decades <= 0.0) return options.scale;
  return options.scale * std::pow(10.0, options.scale_decades * (rng.uniform() - 0.5));
}

}  // namespace driftlight
