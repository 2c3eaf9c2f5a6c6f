// SPDX-License-Identifier: Apache-2.0
/// Laws of the stage-by-stage derivatives: by jets and by hand they equal those of wide Jets over
/// the whole path, and the Riccati factor is a root of their Q.
#include "driftlight/linearization.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <vector>

#include "driftlight/factor.h"
#include "support/path_classes.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

struct Prepared {
  Chart chart;
  PathDerivatives wide;
  Linearization local;

  Prepared(const Scene& scene, const Path& path, DerivativeMethod method)
      : chart(scene, path.topology, path.coordinates) {
    differentiate(scene, path.topology, chart, {}, wide);
    linearize(scene, path.topology, chart, method, {}, local);
  }
  Matrix q() const { return wide.q.selfadjointView<Eigen::Lower>(); }
};

class Linearize : public testing::TestWithParam<DerivativeMethod> {};

INSTANTIATE_TEST_SUITE_P(Methods, Linearize,
                         testing::Values(DerivativeMethod::Jet, DerivativeMethod::Hand),
                         [](const auto& test) {
                           return test.param == DerivativeMethod::Jet ? "Jet" : "Hand";
                         });

/// Differences in units of the widths: |D^-1/2 x|, D = diag Q.
double scaled_norm(const Vector& x, const Matrix& q) {
  return x.cwiseQuotient(q.diagonal().cwiseSqrt()).norm();
}

// Law: gradient and Q are those of wide Jets, in every class.
TEST_P(Linearize, EqualsWideJetsInEveryClass) {
  ClassCounter classes;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 1000, 21)) {
      const Prepared p(test.scene, path, GetParam());
      const Matrix q = p.q();
      const Vector difference = p.local.gradient - p.wide.gradient;
      EXPECT_LT(scaled_norm(difference, q), 1e-10 * (1.0 + scaled_norm(p.wide.gradient, q)))
          << test.name << " gradient " << p.local.gradient.transpose() << "\n instead of "
          << p.wide.gradient.transpose();
      const Vector scale = q.diagonal().cwiseSqrt().cwiseInverse();
      const Matrix error =
          scale.asDiagonal() * (constraint_matrix(p.local) - q) * scale.asDiagonal();
      EXPECT_LT(error.norm(), 1e-10) << test.name;
      classes.add(classes_of(test.scene, path));
    }
  }
  for (const std::string& missing : classes.missing(3)) ADD_FAILURE() << missing;
}

// Law: what is asked for does not change what comes out, and nothing else does come out.
TEST_P(Linearize, PartialRequestsAgreeWithTheFullOne) {
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 22)) {
      const Prepared p(test.scene, path, GetParam());
      Linearization gradient;
      linearize(test.scene, path.topology, p.chart, GetParam(), {true, false}, gradient);
      EXPECT_LT((gradient.gradient - p.local.gradient).norm(), 1e-12 * p.local.gradient.norm());
      EXPECT_EQ(gradient.row_count(), 0);
      Linearization constraints;
      linearize(test.scene, path.topology, p.chart, GetParam(), {false, true}, constraints);
      const Matrix q = constraint_matrix(p.local);
      EXPECT_LT((constraint_matrix(constraints) - q).norm(), 1e-12 * q.norm());
      EXPECT_EQ(constraints.gradient.size(), 0);
    }
  }
}

// Law: F^T F = Q, F^-1 and F^-T are its inverses, and log_det is half that of Q.
TEST_P(Linearize, RiccatiFactorIsARootOfQ) {
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 500, 23)) {
      const Prepared p(test.scene, path, GetParam());
      const RiccatiFactor factor(p.local);
      ASSERT_EQ(factor.status(), RiccatiFactor::Status::Ok);
      const Matrix q = p.q();
      const auto d = q.rows();
      Matrix f(d, d);
      Matrix inverse(d, d);
      Matrix transposed(d, d);
      for (Eigen::Index j = 0; j < d; ++j) {
        f.col(j) = factor.apply(Vector(Vector::Unit(d, j)));
        inverse.col(j) = factor.solve(Vector(f.col(j)));
        transposed.col(j) = factor.solve_transposed(Vector(Vector::Unit(d, j)));
      }
      const Vector scale = q.diagonal().cwiseSqrt().cwiseInverse();
      const Matrix error = scale.asDiagonal() * (f.transpose() * f - q) * scale.asDiagonal();
      EXPECT_LT(error.norm(), 1e-10);
      const Matrix unit = Matrix::Identity(d, d);
      // Rounding of a triangular solve grows with the condition of F in units of the widths.
      EXPECT_LT((inverse - unit).norm(), 1e-6) << test.name;
      EXPECT_LT((transposed * f.transpose() - unit).norm(), 1e-6) << test.name;
      const Eigen::LLT<Matrix> cholesky(q);
      EXPECT_NEAR(factor.log_det(), Matrix(cholesky.matrixL()).diagonal().array().log().sum(),
                  1e-8);
    }
  }
}

/// One stage with two coordinates and these residual rows.
Linearization single_stage(const std::vector<Vec2d>& rows) {
  Linearization path;
  path.stage_count = 1;
  path.block_count = 1;
  path.stages[0].kind = Stage::Kind::Terminal;
  path.stages[0].has_block = true;
  path.stages[0].rows_end = static_cast<int>(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    path.rows.row(static_cast<Eigen::Index>(i)) << 0, 0, 0, 0, rows[i].x(), rows[i].y(), 0, 0;
  return path;
}

// Law: what cannot be factorised is told apart from what is not finite, and both from what can.
TEST(RiccatiFactor, StatusTellsWhatFailed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(RiccatiFactor(single_stage({{1, 2}})).status(), RiccatiFactor::Status::Ok);
  // The floor drowns in rounding.
  EXPECT_EQ(RiccatiFactor(single_stage({{1e10, 1e10}})).status(),
            RiccatiFactor::Status::Indefinite);
  EXPECT_EQ(RiccatiFactor(single_stage({{1, nan}})).status(), RiccatiFactor::Status::NonFinite);
  EXPECT_EQ(RiccatiFactor(single_stage({{1, 1e200}})).status(), RiccatiFactor::Status::NonFinite);
}

// Law: a matrix that is not positive definite has no Cholesky factor.
TEST(CholeskyFactor, NoneOfAnIndefiniteMatrix) {
  EXPECT_TRUE(CholeskyFactor::of(Matrix::Identity(3, 3)).has_value());
  Matrix q = Matrix::Identity(3, 3);
  for (const double bad : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    q(1, 1) = bad;
    EXPECT_FALSE(CholeskyFactor::of(q).has_value());
  }
}

}  // namespace
}  // namespace driftlight::test
