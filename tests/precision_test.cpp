// SPDX-License-Identifier: Apache-2.0
/// Laws of the Hessian of the potential and of the dense precision matrices.
#include "driftlight/precision.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "driftlight/hessian.h"
#include "driftlight/small_step.h"
#include "support/dense.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

Vector zero(const Chart& chart) { return Vector::Zero(chart.dimension()); }

/// Central differences of the gradient along all coordinates of the chart.
Matrix differences_of_gradient(const Scene& scene, const Path& path, const Chart& chart,
                               const Vector& widths) {
  const int d = chart.dimension();
  Matrix h(d, d);
  Linearization at;
  for (int j = 0; j < d; ++j) {
    const double step = 1e-4 * widths[j];
    Vector delta = Vector::Zero(d);
    delta[j] = step;
    linearize(scene, path.topology, chart.displaced(delta), DerivativeMethod::Hand, {true, false},
              at);
    h.col(j) = at.gradient;
    delta[j] = -step;
    linearize(scene, path.topology, chart.displaced(delta), DerivativeMethod::Hand, {true, false},
              at);
    h.col(j) = (h.col(j) - at.gradient) / (2.0 * step);
  }
  return h;
}

/// 1 / (3 sqrt(Q_jj)), at most 1.
Vector widths_of(const Scene& scene, const Path& path, const Chart& chart) {
  Matrix q;
  constraint_matrix(scene, path.topology, chart, zero(chart), q);
  return (1.0 / (3.0 * q.diagonal().array().sqrt())).min(1.0);
}

/// Errors of all light paths, from the smallest on.
template <class Error>
std::vector<double> errors_of(int count, std::uint64_t seed, const Error& error) {
  std::vector<double> errors;
  for (const TestScene& test : test_scenes())
    for (const Path& path : light_paths(test, count, seed)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      errors.push_back(error(test.scene, path, chart));
    }
  std::sort(errors.begin(), errors.end());
  return errors;
}

// Law: the Hessian is the derivative of the gradient, in units of the widths.
TEST(Hessian, IsTheDerivativeOfTheGradient) {
  const auto errors =
      errors_of(200, 161, [](const Scene& scene, const Path& path, const Chart& chart) {
        const Vector widths = widths_of(scene, path, chart);
        const auto scaled = [&](const Matrix& h) -> Matrix {
          return widths.asDiagonal() * h * widths.asDiagonal();
        };
        const Matrix exact = scaled(hessian(scene, path.topology, chart, zero(chart)));
        const Matrix numeric = scaled(differences_of_gradient(scene, path, chart, widths));
        return (exact - numeric).norm() / (exact.norm() + 1e-3);
      });
  // The tail: seams of textures within a step, and what rounding leaves of narrow lobes.
  EXPECT_LT(errors[errors.size() / 2], 1e-6);
  EXPECT_LT(errors[errors.size() * 98 / 100], 1e-3);
}

// Law: |H| / 9 + floor has the eigenvectors of H, and is positive definite.
TEST(Precision, OfTheHessianIsItsAbsoluteValue) {
  const TestScene& test = test_scenes().front();
  for (const Path& path : light_paths(test, 100, 162)) {
    const Chart chart(test.scene, path.topology, path.coordinates);
    const Matrix h = hessian(test.scene, path.topology, chart, zero(chart));
    const Matrix q = hessian_precision(test.scene, path.topology, chart, zero(chart));
    const Matrix rest = 9.0 * (q - kConstraintFloor * Matrix::Identity(q.rows(), q.cols()));
    EXPECT_LT((rest * rest - h * h).norm(), 1e-9 * (1.0 + h.squaredNorm()));
    EXPECT_GT(eigenvalues(q)[0], 0.99 * kConstraintFloor);
  }
}

// Law: the diagonal is that of the matrix of constraints.
TEST(Precision, DiagonalIsThatOfTheConstraints) {
  for (const TestScene& test : test_scenes())
    for (const Path& path : light_paths(test, 50, 163)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      Linearization at;
      linearize(test.scene, path.topology, chart, DerivativeMethod::Hand, {false, true}, at);
      const Matrix q = constraint_matrix(at);
      const Matrix diagonal = diagonal_precision(at);
      EXPECT_LT((Matrix(q.diagonal().asDiagonal()) - diagonal).norm(), 1e-12 * q.norm());
    }
}

/// sum_j d (Q^-1)_ij / d delta_j, by differences of the inverse itself.
Vector differences_of_inverse(const Scene& scene, const Path& path, const Chart& chart,
                              PreconditionerKind kind, double floor) {
  const auto inverse_at = [&](const Vector& delta) -> Matrix {
    if (kind == PreconditionerKind::Hessian)
      return inverse(hessian_precision(scene, path.topology, chart, delta, floor));
    Matrix q;
    constraint_matrix(scene, path.topology, chart, delta, q);
    q.diagonal().array() += floor - kConstraintFloor;
    return q.diagonal().cwiseInverse().asDiagonal();
  };
  const Vector widths = widths_of(scene, path, chart);
  Vector sum = zero(chart);
  for (int j = 0; j < chart.dimension(); ++j) {
    Vector delta = zero(chart);
    delta[j] = 1e-4 * widths[j];
    sum += (inverse_at(delta) - inverse_at(-delta)).col(j) / (2.0 * delta[j]);
  }
  return sum;
}

// Law: dense_divergence() is the divergence of the inverse.
TEST(Precision, DivergenceIsThatOfTheInverse) {
  for (const auto& [kind, floor] : {std::pair(PreconditionerKind::Diagonal, kConstraintFloor),
                                    std::pair(PreconditionerKind::Hessian, kConstraintFloor),
                                    std::pair(PreconditionerKind::Diagonal, 1.0),
                                    std::pair(PreconditionerKind::Hessian, 1.0)}) {
    const auto errors = errors_of(
        30, 164,
        [&, of = kind, with = floor](const Scene& scene, const Path& path, const Chart& chart) {
          const Vector result = dense_divergence(scene, path.topology, chart, of, with);
          const Vector direct = differences_of_inverse(scene, path, chart, of, with);
          return (result - direct).norm() / (direct.norm() + 1e-6);
        });
    EXPECT_LT(errors[errors.size() / 2], 1e-5);
    EXPECT_LT(errors[errors.size() * 9 / 10], 1e-2);
  }
}

// Law: a step takes Q from its preconditioner and its trust region: its density is that of a step
// with this matrix.
TEST(Precision, StepsTakeIt) {
  const TestScene& test = test_scenes().front();
  Rng rng(165, Stream::Test, 0);
  for (const Path& path : light_paths(test, 50, 165)) {
    for (const PreconditionerKind kind :
         {PreconditionerKind::Constraints, PreconditionerKind::Diagonal,
          PreconditionerKind::Hessian}) {
      KernelOptions options;
      options.trust = 0.3;
      options.preconditioner = kind;
      options.drift = Drift::None;
      ChainState state;
      state.topology = path.topology;
      state.coordinates = path.coordinates;
      prepare_step(test.scene, options, state);
      ASSERT_TRUE(state.finite);
      Linearization at;
      linearize(test.scene, path.topology, state.chart, DerivativeMethod::Jet, {false, true}, at);
      at.floor = kConstraintFloor / 0.09;
      const auto matrix = [&]() -> Matrix {
        if (kind == PreconditionerKind::Constraints) return constraint_matrix(at);
        if (kind == PreconditionerKind::Diagonal) return diagonal_precision(at);
        return hessian_precision(test.scene, path.topology, state.chart, zero(state.chart),
                                 at.floor);
      };
      const Matrix q = matrix();
      const StepDistribution expected(options, state.chart.dimension(), *CholeskyFactor::of(q),
                                      nullptr, nullptr);
      const Vector delta = expected.sample(0.5, rng);
      EXPECT_NEAR(state.step.log_density(delta, 0.5), expected.log_density(delta, 0.5), 1e-8);
    }
  }
}

}  // namespace
}  // namespace driftlight::test
