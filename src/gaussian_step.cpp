// SPDX-License-Identifier: Apache-2.0
#include "gaussian_step.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace driftlight {
namespace {

/// Bounds of M, and what keeps it finite (Luan et al. 2020).
constexpr double kLeastM = 0.01;
constexpr double kLargestM = 100;
constexpr double kStabilizer = 1e-3;

}  // namespace

GaussianStep GaussianStep::isotropic(int dimension, double sigma) {
  GaussianStep step;
  step.mean_.setZero(dimension);
  step.deviation_.setConstant(dimension, sigma);
  step.set_norm();
  return step;
}

GaussianStep GaussianStep::hamiltonian(const Vector& gradient, const Matrix& hessian,
                                       double sigma) {
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(hessian);
  if (eigen.info() != Eigen::Success) return isotropic(static_cast<int>(gradient.size()), sigma);
  const double half_turn = 0.5 * kPi;
  const double spread = std::sinh(half_turn) * std::sinh(half_turn);
  const double push = std::cosh(half_turn) - 1.0;
  GaussianStep step;
  step.rotated_ = true;
  step.rotation_ = eigen.eigenvectors();
  step.mean_ = step.rotation_.transpose() * gradient;
  step.deviation_.resize(gradient.size());
  for (Eigen::Index i = 0; i < gradient.size(); ++i) {
    const double l = eigen.eigenvalues()[i];
    const double inverse_v = l < 0.0 ? -l : l / spread;
    const double variance = 1.0 / (inverse_v + 1.0 / (sigma * sigma));
    step.deviation_[i] = std::sqrt(variance);
    step.mean_[i] *= (l < 0.0 ? 1.0 : push / spread) * variance;
  }
  step.set_norm();
  return step;
}

GaussianStep GaussianStep::langevin(const Vector& direction, const Vector& preconditioner,
                                    double eps, double sigma) {
  GaussianStep step;
  const auto variance =
      ((eps * preconditioner).array().inverse() + 1.0 / (sigma * sigma)).inverse();
  step.mean_ = 0.5 * variance * direction.array();
  step.deviation_ = variance.sqrt();
  step.set_norm();
  return step;
}

void GaussianStep::set_norm() {
  log_norm_ = -deviation_.array().log().sum() -
              0.5 * std::log(2.0 * kPi) * static_cast<double>(deviation_.size());
}

Vector GaussianStep::sample(Rng& rng) const {
  Vector offset(mean_.size());
  for (Eigen::Index i = 0; i < mean_.size(); ++i)
    offset[i] = mean_[i] + deviation_[i] * rng.normal();
  if (!rotated_) return offset;
  return rotation_ * offset;
}

double GaussianStep::log_density(const Vector& offset) const {
  const Vector along = rotated_ ? Vector(rotation_.transpose() * offset) : offset;
  return log_norm_ - 0.5 * ((along - mean_).array() / deviation_.array()).square().sum();
}

GaussianStep GradientMoments::step(const LmcOptions& options) const {
  const Vector m = (square.array().sqrt() + kStabilizer).inverse().max(kLeastM).min(kLargestM);
  return GaussianStep::langevin(direction, m, options.step, options.sigma);
}

double GradientMemory::weight(const LmcOptions& options) const {
  return std::pow(static_cast<double>(count_) + 1.0, -options.adaptation_decay);
}

Vector GradientMemory::bounded(const Vector& gradient, const LmcOptions& options) {
  const double length = gradient.norm();
  if (!(length > options.gradient_bound)) return gradient;
  return options.gradient_bound / length * gradient;
}

GradientMoments GradientMemory::moments(const Vector& gradient, const LmcOptions& options) const {
  GradientMoments result{gradient, gradient.cwiseAbs2()};
  if (count_ > 0) {
    const double former = options.momentum * weight(options);
    result.direction = former * first_ + (1.0 - former) * gradient;
    result.square = options.locality * result.square + (1.0 - options.locality) * second_;
  }
  return result;
}

void GradientMemory::add(const Vector& gradient, const LmcOptions& options) {
  const double w = weight(options);
  if (count_++ == 0) {
    first_.setZero(gradient.size());
    second_.setZero(gradient.size());
  }
  first_ += w * (gradient - first_);
  second_ += w * (gradient.cwiseAbs2() - second_);
}

}  // namespace driftlight
