// SPDX-License-Identifier: Apache-2.0
/// Laws of the derivatives of a path: they equal what finite differences say, and no choice of
/// tangents or of pass width shows in them.
#include "driftlight/gradient.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "driftlight/finite_difference.h"
#include "support/dense.h"
#include "support/path_classes.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

constexpr int kPathsPerScene = 1000;

/// The potential along coordinate j of the chart.
double potential(const Scene& scene, const Path& path, const Chart& chart, int j, double x) {
  Vector delta = Vector::Zero(chart.dimension());
  delta[j] = x;
  return -contribution(scene, path.topology, chart.retract(delta)).log_target;
}

/// How far a gradient is from finite differences.
struct GradientReport {
  std::vector<double> errors;  ///< relative, by coordinate
  int kinks = 0;               ///< coordinates left out, with a kink next to the path

  double worst() const {
    return errors.empty() ? 0.0 : *std::max_element(errors.begin(), errors.end());
  }
};

/// Compares each coordinate in units of the width w_j = 1 / (3 sqrt(Q_jj)) in which U changes by
/// about one: |g - f| / max(|g|, |f|, 0.01 / w).
GradientReport compare(const Scene& scene, const Path& path, const Chart& chart,
                       const Vector& gradient, const Matrix& q) {
  GradientReport report;
  for (int j = 0; j < chart.dimension(); ++j) {
    const auto f = [&](double x) { return potential(scene, path, chart, j, x); };
    const double width = std::min(1.0, 1.0 / (3.0 * std::sqrt(q(j, j))));
    const double h = 0.01 * width;
    const Derivative expected = ridders(f, h);
    const double scale = std::max({std::abs(gradient[j]), std::abs(expected.value), 0.01 / width});
    const OneSidedSlopes slopes = one_sided_slopes(f, h);
    const OneSidedSlopes fine = one_sided_slopes(f, 0.25 * h);
    // Smooth: the difference of the slopes shrinks sixteen times. A kink keeps it, or moves it.
    const double coarse_gap = std::abs(slopes.right - slopes.left);
    const double fine_gap = std::abs(fine.right - fine.left);
    const bool smooth = coarse_gap < 1e-6 * scale || fine_gap < 0.15 * coarse_gap;
    if (!smooth || !(expected.error < 1e-6 * scale)) {
      ++report.kinks;
      continue;
    }
    report.errors.push_back(std::abs(gradient[j] - expected.value) / scale);
  }
  return report;
}

/// Chart and derivatives of a path.
struct Prepared {
  Chart chart;
  PathDerivatives derivatives;

  Prepared(const Scene& scene, const Path& path) : chart(scene, path.topology, path.coordinates) {
    differentiate(scene, path.topology, chart, {}, derivatives);
  }
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Law: grad U of differentiate is the derivative of -log_target along the chart, in every class.
TEST(Gradient, EqualsRiddersDifferencesInEveryClass) {
  ClassCounter classes;
  std::vector<double> errors;
  int kinks = 0;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, kPathsPerScene, 11)) {
      const Prepared p(test.scene, path);
      ASSERT_TRUE(p.derivatives.all_finite({}));
      const GradientReport report =
          compare(test.scene, path, p.chart, p.derivatives.gradient, p.derivatives.q);
      EXPECT_LT(report.worst(), 2e-6) << test.name;
      errors.insert(errors.end(), report.errors.begin(), report.errors.end());
      kinks += report.kinks;
      if (report.kinks == 0) classes.add(classes_of(test.scene, path));
    }
  }
  EXPECT_LT(median(errors), 1e-9);
  EXPECT_LT(kinks, static_cast<int>(errors.size()) / 50);
  for (const std::string& missing : classes.missing(3)) ADD_FAILURE() << missing;
}

// Law: the checker above can fail. A gradient with one component of the wrong sign, or one per cent
// too large, is told from the right one.
TEST(Gradient, WrongGradientFailsTheChecker) {
  int tried = 0;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 20, 12)) {
      const Prepared p(test.scene, path);
      const Matrix& q = p.derivatives.q;
      Eigen::Index j = 0;
      const double largest =
          p.derivatives.gradient.cwiseAbs().cwiseQuotient(q.diagonal().cwiseSqrt()).maxCoeff(&j);
      if (largest < 1e-2) continue;
      if (compare(test.scene, path, p.chart, p.derivatives.gradient, q).kinks > 0) continue;
      ++tried;
      Vector wrong_sign = p.derivatives.gradient;
      wrong_sign[j] = -wrong_sign[j];
      EXPECT_GT(compare(test.scene, path, p.chart, wrong_sign, q).worst(), 0.1);
      Vector wrong_factor = p.derivatives.gradient;
      wrong_factor[j] *= 1.01;
      EXPECT_GT(compare(test.scene, path, p.chart, wrong_factor, q).worst(), 1e-4);
    }
  }
  EXPECT_GT(tried, 40);
}

/// Residuals and precisions in the order in which they come.
template <Scalar T>
struct Recorder {
  std::vector<T> residuals;
  std::vector<double> precisions;

  void add(const T& residual, const Stripped<T>& precision) {
    residuals.push_back(residual);
    precisions.push_back(value(precision));
  }
};

/// Residuals at a point of the chart, as numbers or as jets over N coordinates from the first on.
template <Scalar T>
Recorder<T> residuals_at(const Scene& scene, const Path& path, const Chart& chart,
                         const std::vector<T>& delta) {
  Recorder<T> recorder;
  ConstraintVisitor<T, Recorder<T>> visitor(recorder);
  const auto blocks = [&](int k) {
    const auto i = static_cast<std::size_t>(2 * k);
    return chart.retract(k, delta[i], delta[i + 1]);
  };
  walk<T>(scene, path.topology, blocks, visitor);
  return recorder;
}

// Law: Q is 1/9 sum w J^T J + floor of the recorded residuals, and each row of J is the derivative
// that Ridders differences of the residuals give.
TEST(Constraints, JacobiansEqualRiddersDifferences) {
  constexpr int kWidth = 2 * kMaxPathLength;
  using J = ceres::Jet<double, kWidth>;
  ClassCounter classes;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 250, 13)) {
      classes.add(classes_of(test.scene, path));
      const Prepared p(test.scene, path);
      const int d = p.chart.dimension();
      std::vector<J> seeded;
      for (int j = 0; j < d; ++j) seeded.emplace_back(0.0, j);
      const Recorder<J> rows = residuals_at<J>(test.scene, path, p.chart, seeded);
      Matrix q = Matrix::Identity(d, d) * kConstraintFloor;
      for (std::size_t i = 0; i < rows.residuals.size(); ++i) {
        ASSERT_GE(rows.precisions[i], 0.0);
        const Vector row = rows.residuals[i].v.head(d);
        q += rows.precisions[i] / 9.0 * (row * row.transpose());
      }
      const Matrix full = p.derivatives.q.selfadjointView<Eigen::Lower>();
      EXPECT_LT((q - full).norm(), 1e-9 * q.norm());

      for (int j = 0; j < d; ++j) {
        const double width = std::min(1.0, 1.0 / (3.0 * std::sqrt(q(j, j))));
        const auto residuals = [&](double x) {
          std::vector<double> delta(static_cast<std::size_t>(d));
          delta[static_cast<std::size_t>(j)] = x;
          return residuals_at<double>(test.scene, path, p.chart, delta).residuals;
        };
        // Far off a lobe may vanish, and its residuals with it.
        const std::size_t count = rows.residuals.size();
        double step = 0.05 * width;
        while (residuals(step).size() != count || residuals(-step).size() != count) step *= 0.25;
        for (std::size_t i = 0; i < count; ++i) {
          const auto f = [&](double x) { return residuals(x).at(i); };
          // In units of the residual's sigma per width of the coordinate.
          const double sigma = 1.0 / std::sqrt(std::max(rows.precisions[i], 1e-6));
          const auto tolerance = [&](const Derivative& x) {
            return 10.0 * x.error + 1e-7 * sigma / width;
          };
          const double jet = rows.residuals[i].v[j];
          Derivative expected = ridders(f, step);
          // Within the step there may be a seam of a bump map, where normals jump.
          if (std::abs(jet - expected.value) > tolerance(expected))
            expected = ridders(f, 0.01 * step);
          EXPECT_NEAR(jet, expected.value, tolerance(expected))
              << test.name << " residual " << i << " coordinate " << j;
        }
      }
    }
  }
  for (const std::string& missing : classes.missing(1)) ADD_FAILURE() << missing;
}

// Law: Q is symmetric positive definite, with no eigenvalue below the floor.
TEST(Constraints, MatrixIsPositiveDefinite) {
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, kPathsPerScene, 14)) {
      const Prepared p(test.scene, path);
      const Matrix full = p.derivatives.q.selfadjointView<Eigen::Lower>();
      const Matrix floorless =
          full - 0.999 * kConstraintFloor * Matrix::Identity(full.rows(), full.cols());
      // Rounding of the largest entries may hide the floor.
      const double rounding = 1e-13 * full.norm();
      EXPECT_TRUE(rounding > 0.01 * kConstraintFloor || is_positive_definite(floorless));
    }
  }
}

// Law: constraint_matrix at delta = 0 is the Q of differentiate.
TEST(Constraints, MatrixAtTheBasePointIsTheSame) {
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 15)) {
      const Prepared p(test.scene, path);
      Matrix q;
      constraint_matrix(test.scene, path.topology, p.chart, Vector::Zero(p.chart.dimension()), q);
      const Matrix difference = (q - p.derivatives.q).triangularView<Eigen::Lower>();
      EXPECT_LT(difference.norm(), 1e-9 * q.norm());
    }
  }
}

// Law: what is asked for does not change what comes out.
TEST(Gradient, PartialRequestsAgreeWithTheFullOne) {
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 16)) {
      const Prepared p(test.scene, path);
      PathDerivatives gradient;
      differentiate(test.scene, path.topology, p.chart, {true, false}, gradient);
      PathDerivatives constraints;
      differentiate(test.scene, path.topology, p.chart, {false, true}, constraints);
      EXPECT_LT((gradient.gradient - p.derivatives.gradient).norm(),
                1e-9 * p.derivatives.gradient.norm());
      const Matrix difference = (constraints.q - p.derivatives.q).triangularView<Eigen::Lower>();
      EXPECT_LT(difference.norm(), 1e-9 * p.derivatives.q.norm());
    }
  }
}

/// Gradient by passes of two coordinates, one block at a time.
Vector gradient_by_blocks(const Scene& scene, const Path& path, const Chart& chart) {
  using J = ceres::Jet<double, 2>;
  Vector result(chart.dimension());
  for (int seeded = 0; seeded < chart.block_count(); ++seeded) {
    const auto blocks = [&](int k) {
      return k == seeded ? chart.retract(k, J(0.0, 0), J(0.0, 1))
                         : constant<J>(chart.block(k).point);
    };
    ContributionVisitor<J> visitor;
    walk<J>(scene, path.topology, blocks, visitor);
    result.segment<2>(2 * seeded) = -visitor.log_target().v;
  }
  return result;
}

/// Bounces between mirrors of rough metal and plaster: paths of every length.
TestScene corridor() {
  SceneBuilder builder;
  const auto metal = builder.add_bsdf(RoughConductor{{Distribution::Ggx, 0.3}});
  const auto plaster = builder.add_bsdf(Diffuse{Texture(Rgbd::Constant(0.8))});
  const auto shiny = builder.add_material({metal, std::nullopt});
  const auto matt = builder.add_material({plaster, std::nullopt});
  builder.add_shape(quad({-1, -1, 4}, {8, 0, 0}, {0, 0, -8}), shiny);
  builder.add_shape(quad({-1, 1, -4}, {8, 0, 0}, {0, 0, 8}), shiny);
  builder.add_shape(quad({-1, -1, -1.5}, {8, 0, 0}, {0, 2, 0}), matt);
  builder.add_shape(quad({-1, -1, 4}, {0, 2, 0}, {8, 0, 0}), matt);
  builder.add_shape(quad({5, -0.5, -0.5}, {0, 0, 1}, {0, 1, 0}), matt, Rgbd::Ones());
  builder.set_camera(look_at({0, 0, 0}, {1, 0.3, 0.2}, 0.7));
  return {"corridor", builder.build(), 16};
}

// Law: the gradient does not depend on the width of the passes in which it is computed (4, 8 or 16
// coordinates at a time), for paths of 3 to 10 vertices and more.
TEST(Gradient, IndependentOfPassWidth) {
  const TestScene test = corridor();
  std::array<int, kMaxPathLength + 1> seen{};
  for (const Path& path : light_paths(test, 1500, 17)) {
    const Prepared p(test.scene, path);
    const Vector expected = gradient_by_blocks(test.scene, path, p.chart);
    EXPECT_LT((p.derivatives.gradient - expected).norm(), 1e-9 * expected.norm());
    ++seen[static_cast<std::size_t>(path.topology.length())];
  }
  for (std::size_t length = 2; length <= 12; ++length) EXPECT_GT(seen[length], 5) << length;
}

// Law: a turn R of the tangents turns the gradient and Q with it: g -> R^T g, Q -> R^T Q R.
TEST(Gradient, CovariantUnderRotationsOfTheChart) {
  Rng rng(18, Stream::Test, 0);
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 18)) {
      const Prepared p(test.scene, path);
      Chart turned = p.chart;
      const int d = turned.dimension();
      Matrix rotation = Matrix::Identity(d, d);
      for (int k = 0; k < turned.block_count(); ++k) {
        const double angle = 2.0 * kPi * rng.uniform();
        turned.rotate(k, angle);
        rotation.block<2, 2>(2 * k, 2 * k) = Eigen::Rotation2Dd(angle).toRotationMatrix();
      }
      PathDerivatives derivatives;
      differentiate(test.scene, path.topology, turned, {}, derivatives);
      const Vector expected = rotation.transpose() * p.derivatives.gradient;
      EXPECT_LT((derivatives.gradient - expected).norm(), 1e-9 * expected.norm());
      const Matrix q = p.derivatives.q.selfadjointView<Eigen::Lower>();
      const Matrix turned_q = derivatives.q.selfadjointView<Eigen::Lower>();
      EXPECT_LT((turned_q - rotation.transpose() * q * rotation).norm(), 1e-9 * q.norm());
    }
  }
}

// Law: every path that carries light has finite derivatives, perfect mirrors (eta = 0) included.
TEST(Gradient, FiniteOnEveryPath) {
  for (const TestScene& test : test_scenes())
    for (const Path& path : light_paths(test, kPathsPerScene, 19))
      EXPECT_TRUE(Prepared(test.scene, path).derivatives.all_finite({}));
}

}  // namespace
}  // namespace driftlight::test
