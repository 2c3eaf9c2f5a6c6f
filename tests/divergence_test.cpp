// SPDX-License-Identifier: Apache-2.0
/// Laws of the divergence: the differences of divergence() against exact second derivatives, which
/// Jets of Jets give.
#include "driftlight/divergence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "driftlight/constraints.h"
#include "driftlight/exact_divergence.h"
#include "driftlight/gradient.h"
#include "support/dense.h"
#include "support/path_classes.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

/// Sums Q - floor = 1/9 sum w J^T J as jets: the value and its derivatives over all coordinates.
template <int N>
class JetMatrix {
 public:
  using S = ceres::Jet<double, N>;
  using T = ceres::Jet<S, N>;

  explicit JetMatrix(int dimension) : dimension_(dimension), q_(N, N) { q_.setConstant(S(0.0)); }

  void add(const T& residual, const S& precision) {
    for (int i = 0; i < dimension_; ++i)
      for (int j = 0; j < dimension_; ++j)
        q_(i, j) += precision * residual.v[i] * residual.v[j] * (1.0 / 9.0);
  }

  Matrix value() const {
    return Matrix::NullaryExpr(dimension_, dimension_, [&](Eigen::Index i, Eigen::Index j) {
      return q_(i, j).a + (i == j ? kConstraintFloor : 0.0);
    });
  }
  /// dQ / d delta_k
  Matrix derivative(int k) const {
    return Matrix::NullaryExpr(dimension_, dimension_,
                               [&](Eigen::Index i, Eigen::Index j) { return q_(i, j).v[k]; });
  }

 private:
  int dimension_;
  Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> q_;
};

/// The constraint visitor over jets of jets at the base point of the chart.
template <int N>
JetMatrix<N> jet_matrix(const Scene& scene, const Path& path, const Chart& chart) {
  using S = ceres::Jet<double, N>;
  using T = ceres::Jet<S, N>;
  const auto seeded = [](int j) {
    T x(S(0.0, j));
    x.v[j] = S(1.0);
    return x;
  };
  const auto blocks = [&](int k) { return chart.retract(k, seeded(2 * k), seeded(2 * k + 1)); };
  JetMatrix<N> matrix(chart.dimension());
  ConstraintVisitor<T, JetMatrix<N>> visitor(matrix);
  walk<T>(scene, path.topology, blocks, visitor);
  return matrix;
}

/// div(Q^-1)_i = sum_j (d_j Q^-1)_ij,  d_j Q^-1 = -Q^-1 (d_j Q) Q^-1, from wide jets and all of dQ.
template <int N>
Vector plain_divergence(const Scene& scene, const Path& path, const Chart& chart) {
  const JetMatrix<N> q = jet_matrix<N>(scene, path, chart);
  const Matrix inverse = test::inverse(q.value());
  Vector sum = Vector::Zero(chart.dimension());
  for (int j = 0; j < chart.dimension(); ++j) sum += q.derivative(j) * inverse.col(j);
  return -inverse * sum;
}

// Law: divergence() is div(Q^-1) in every class of path. The error is measured in the norm of the
// widths, |L^T (x - y)| / |L^T y|, in which the step sees it.
TEST(Divergence, EqualsNestedJetsInEveryClass) {
  ClassCounter classes;
  std::vector<double> errors;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 1000, 41)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      PathDerivatives derivatives;
      differentiate(test.scene, path.topology, chart, {false, true}, derivatives);
      // One in eight with a small trust region.
      const double floor = (errors.size() % 8 == 7 ? 30.0 : 1.0) * kConstraintFloor;
      const Vector numeric =
          divergence(test.scene, path.topology, chart, DerivativeMethod::Hand, {}, floor);
      const Vector exact = exact_divergence(test.scene, path.topology, chart, floor);
      Matrix q = derivatives.q.selfadjointView<Eigen::Lower>();
      q.diagonal().array() += floor - kConstraintFloor;
      const Vector difference = numeric - exact;
      errors.push_back(std::sqrt(difference.dot(q * difference) / exact.dot(q * exact)));
      classes.add(classes_of(test.scene, path));
    }
  }
  // The tail: bilinear patches within a step, and matrices with a condition number above 1e5.
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 1e-7);
  EXPECT_LT(errors[errors.size() * 99 / 100], 1e-5);
  EXPECT_LT(errors.back(), 0.05);
  for (const std::string& missing : classes.missing(3)) ADD_FAILURE() << missing;
}

/// |L^T x|, Q = L L^T
double norm(const Vector& x, const Matrix& q) { return std::sqrt(x.dot(q * x)); }

// Law: the divergence by blocks of narrow jets is that of wide jets and the whole of dQ, for paths
// of one block and of several; and those jets sum up to the Q that the library computes.
TEST(Divergence, BlocksOfNestedJetsEqualWideOnes) {
  constexpr int kWide = 12;
  std::array<int, kWide + 1> seen{};
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 42)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      const int d = chart.dimension();
      if (d > kWide) continue;
      ++seen[static_cast<std::size_t>(d)];
      PathDerivatives derivatives;
      differentiate(test.scene, path.topology, chart, {false, true}, derivatives);
      const Matrix q = derivatives.q.selfadjointView<Eigen::Lower>();
      EXPECT_LT((jet_matrix<kWide>(test.scene, path, chart).value() - q).norm(), 1e-9 * q.norm());
      const Vector plain = plain_divergence<kWide>(test.scene, path, chart);
      const Vector blocks = exact_divergence(test.scene, path.topology, chart);
      EXPECT_LT(norm(blocks - plain, q), 1e-6 * norm(plain, q)) << test.name;
    }
  }
  for (const std::size_t d : {2U, 4U, 6U, 8U, 10U}) EXPECT_GT(seen[d], 3) << d;
}

}  // namespace
}  // namespace driftlight::test
