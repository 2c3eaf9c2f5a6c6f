// SPDX-License-Identifier: Apache-2.0
/// Laws of one Langevin step: the formulas of [E63], and that the density is that of the sample.
#include "driftlight/kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <vector>

#include "driftlight/chain.h"
#include "driftlight/divergence.h"
#include "driftlight/gradient.h"
#include "support/chi_square.h"
#include "support/dense.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

constexpr double kC = 0.40824829046386301637;  // 1 / sqrt(6)

/// A state of a chain as a step sees it: Q with widths over two decades, a gradient, a divergence.
struct LocalState {
  Matrix q;
  Vector gradient;
  Vector divergence_of_inverse;
};

LocalState random_state(int dimension, double slope, Rng& rng) {
  const auto normal = [&] { return rng.normal(); };
  const Matrix a = Matrix::NullaryExpr(dimension, dimension, normal);
  Vector stretch(dimension);
  for (int i = 0; i < dimension; ++i) stretch[i] = std::pow(10.0, 2.0 * rng.uniform());
  LocalState state;
  state.q = a.transpose() * stretch.asDiagonal() * a + 0.1 * Matrix::Identity(dimension, dimension);
  state.gradient = slope * Vector::NullaryExpr(dimension, normal);
  state.divergence_of_inverse = 0.1 * Vector::NullaryExpr(dimension, normal);
  return state;
}

/// (E63.3), (E63.8) and (E63.9) word for word, with dense matrices.
struct DirectStep {
  Matrix t;
  Vector a;
  double dt;

  DirectStep(const KernelOptions& options, const LocalState& state, double scale) {
    t = scale * kC * inverse(cholesky(state.q)).transpose();
    const Matrix tt = t * t.transpose();
    a = Vector::Zero(state.q.rows());
    dt = 1.0 / 3.0;
    if (options.drift != Drift::None) {
      a = -tt * state.gradient;
      if (options.drift == Drift::Full) a += scale * scale * kC * kC * state.divergence_of_inverse;
      const double a2 = a.squaredNorm();
      dt = std::min(dt, 2.0 * (t.transpose() * a).squaredNorm() / (a2 * a2));
      dt = std::min(dt, options.epsilon / std::abs(a.dot(state.gradient)));
    }
    dt = std::min(dt / options.safety, options.time_step_cap);
  }
  Matrix covariance() const { return 2.0 * dt * t * t.transpose(); }
  Vector mean() const { return dt * a; }
};

StepDistribution step_of(const KernelOptions& options, const LocalState& state) {
  const bool drift = options.drift != Drift::None;
  return {options, static_cast<int>(state.q.rows()), CholeskyFactor::of(state.q).value(),
          drift ? &state.gradient : nullptr,
          options.drift == Drift::Full ? &state.divergence_of_inverse : nullptr};
}

/// Options with the drift, all else as in [E63]; the defaults are free to change.
KernelOptions options_of(Drift drift) {
  KernelOptions options;
  options.drift = drift;
  options.epsilon = 0.1;
  options.safety = 1;
  options.time_step_cap = 1.0 / 3.0;
  options.scale = 1;
  options.scale_decades = 0;
  return options;
}

const std::vector<Drift> kDrifts{Drift::None, Drift::Gradient, Drift::Full};

// Law: time step, mean and log density are those of the formulas, for the non-symmetric T = c L^-T,
// every drift, scale, safety and cap.
TEST(StepDistribution, FollowsTheFormulas) {
  Rng rng(21, Stream::Test, 0);
  for (const Drift drift : kDrifts) {
    for (const int dimension : {2, 4, 7, 16}) {
      for (const double slope : {0.01, 1.0, 100.0}) {
        for (const double scale : {0.1, 1.0, 3.0}) {
          for (const double safety : {1.0, 10.0}) {
            KernelOptions options = options_of(drift);
            options.safety = safety;
            options.time_step_cap = rng.uniform() < 0.3 ? 0.01 : 1.0 / 3.0;
            const LocalState state = random_state(dimension, slope, rng);
            const StepDistribution step = step_of(options, state);
            const DirectStep direct(options, state, scale);
            EXPECT_NEAR(step.time_step(scale), direct.dt, 1e-10 * direct.dt);
            EXPECT_LT((step.mean(scale) - direct.mean()).norm(),
                      1e-9 * direct.mean().norm() + 1e-15);
            Vector delta(dimension);
            for (int i = 0; i < dimension; ++i) delta[i] = rng.normal();
            const Vector r = delta - direct.mean();
            const Matrix root = cholesky(direct.covariance());
            const double expected =
                -0.5 * ((inverse(root) * r).squaredNorm() + dimension * std::log(2.0 * kPi)) -
                root.diagonal().array().log().sum();
            EXPECT_NEAR(step.log_density(delta, scale), expected, 1e-8 * std::abs(expected));
          }
        }
      }
    }
  }
}

// Law: each of the three limits of (E63.9) binds somewhere, or the law above would be idle.
TEST(StepDistribution, EveryLimitOfTheTimeStepBinds) {
  Rng rng(22, Stream::Test, 0);
  int free_limit = 0;
  int ratio_limit = 0;
  int slope_limit = 0;
  for (int i = 0; i < 300; ++i) {
    KernelOptions options = options_of(Drift::Full);
    options.epsilon = std::pow(10.0, 4.0 * rng.uniform() - 2.0);
    const LocalState state = random_state(4, std::pow(10.0, 4.0 * rng.uniform() - 2.0), rng);
    const DirectStep direct(options, state, 1.0);
    const double a2 = direct.a.squaredNorm();
    const double ratio = 2.0 * (direct.t.transpose() * direct.a).squaredNorm() / (a2 * a2);
    const double slope = options.epsilon / std::abs(direct.a.dot(state.gradient));
    if (direct.dt == ratio) ++ratio_limit;
    if (direct.dt == slope) ++slope_limit;
    if (direct.dt == 1.0 / 3.0) ++free_limit;
  }
  EXPECT_GT(free_limit, 10);
  EXPECT_GT(ratio_limit, 10);
  EXPECT_GT(slope_limit, 10);
}

// Law: without drift at dt = 1/3 and scale 1 the covariance is Q^-1 / 9.
TEST(StepDistribution, BrownianCovarianceIsANinthOfTheInverse) {
  Rng rng(23, Stream::Test, 0);
  KernelOptions options = options_of(Drift::None);
  const LocalState state = random_state(3, 1.0, rng);
  const StepDistribution step = step_of(options, state);
  const Matrix expected = inverse(state.q) / 9.0;
  const int count = 40000;
  Matrix second = Matrix::Zero(3, 3);
  for (int i = 0; i < count; ++i) {
    const Vector delta = step.sample(1.0, rng);
    second += delta * delta.transpose() / count;
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(second(i, j), expected(i, j),
                  5.0 * std::sqrt(2.0 * expected(i, i) * expected(j, j) / count));
}

// Law: the identity preconditioner is Q = I / 9.
TEST(StepDistribution, IdentityIsANinthOfTheUnitMatrix) {
  Rng rng(24, Stream::Test, 0);
  for (const Drift drift : {Drift::None, Drift::Gradient}) {
    KernelOptions options = options_of(drift);
    LocalState state = random_state(4, 3.0, rng);
    state.q = Matrix::Identity(4, 4) / 9.0;
    const StepDistribution matrix = step_of(options, state);
    const StepDistribution identity(options, 4, IdentityFactor(4),
                                    drift == Drift::None ? nullptr : &state.gradient, nullptr);
    const Vector delta = random_state(4, 0.3, rng).gradient;
    for (const double scale : {0.2, 2.0}) {
      EXPECT_NEAR(identity.time_step(scale), matrix.time_step(scale), 1e-14);
      EXPECT_NEAR(identity.log_density(delta, scale), matrix.log_density(delta, scale), 1e-10);
      EXPECT_LT((identity.mean(scale) - matrix.mean(scale)).norm(), 1e-13);
    }
  }
}

// Law: samples have the density that log_density says. With r = L_c^-1 (delta - mean) for the
// covariance of the density, |r|^2 is chi^2 with d degrees and each component standard normal; both
// are made uniform and tested.
TEST(StepDistribution, SampleFollowsItsDensity) {
  Rng rng(26, Stream::Test, 0);
  const boost::math::normal normal;
  const int count = 10000;
  const double significance = sidak(0.01, 3 * 3 * 3 * 6);
  for (const Drift drift : kDrifts) {
    for (const int dimension : {2, 5, 12}) {
      for (const double scale : {0.05, 1.0, 4.0}) {
        KernelOptions options = options_of(drift);
        const LocalState state = random_state(dimension, 2.0, rng);
        const StepDistribution step = step_of(options, state);
        const DirectStep direct(options, state, scale);
        const Matrix whitening = inverse(cholesky(direct.covariance()));
        const boost::math::chi_squared radial(dimension);
        std::vector<double> radii;
        std::vector<std::vector<double>> components(static_cast<std::size_t>(dimension));
        for (int i = 0; i < count; ++i) {
          const Vector r = whitening * (step.sample(scale, rng) - direct.mean());
          radii.push_back(boost::math::cdf(radial, r.squaredNorm()));
          for (int j = 0; j < dimension; ++j)
            components[static_cast<std::size_t>(j)].push_back(boost::math::cdf(normal, r[j]));
        }
        EXPECT_GT(chi_square_uniform(radii).p_value, significance);
        for (const auto& z : components) EXPECT_GT(chi_square_uniform(z).p_value, significance);
      }
    }
  }
}

// Law: log10 of the scale is uniform over the decades about the option, and fixed without them.
TEST(DrawScale, LogUniform) {
  Rng rng(28, Stream::Test, 0);
  KernelOptions options = options_of(Drift::None);
  options.scale = 0.3;
  EXPECT_EQ(draw_scale(options, rng), 0.3);
  options.scale_decades = 2;
  std::vector<double> places;
  for (int i = 0; i < 20000; ++i)
    places.push_back(0.5 + 0.5 * std::log10(draw_scale(options, rng) / 0.3));
  for (const double x : places) {
    ASSERT_GE(x, 0.0);
    ASSERT_LE(x, 1.0);
  }
  EXPECT_GT(chi_square_uniform(places).p_value, 0.01);
}

/// One free direction: a chart on the unit sphere about v.
Chart sphere_chart(const Vec3d& v) {
  PathTopology topology;
  topology.block_count = 1;
  topology.end = PathEnd::Environment;
  PathCoordinates coordinates;
  coordinates(0) = v;
  return {test_scenes().front().scene, topology, coordinates};
}

// Law: log_density + log_jacobian is the density per solid angle of the direction that the step
// retracts to (DESIGN 1.4), small steps and large.
TEST(StepDistribution, DensityOnTheSphere) {
  Rng rng(29, Stream::Test, 0);
  const double significance = sidak(0.01, 9);
  for (const Drift drift : kDrifts) {
    for (const double scale : {0.1, 1.0, 3.0}) {
      KernelOptions options = options_of(drift);
      LocalState state = random_state(2, 2.0, rng);
      state.q = Matrix{{2.0, 0.7}, {0.7, 0.9}};
      const StepDistribution step = step_of(options, state);
      const Chart chart = sphere_chart(square_to_sphere(rng.uniform(), rng.uniform()));
      const SphereGrid grid(chart.block(0).point, 24, 16, 2.0);
      const auto draw = [&] { return Vec3d(chart.retract(step.sample(scale, rng))(0)); };
      const auto density = [&](const Vec3d& v) {
        PathCoordinates to;
        to(0) = v;
        const auto inverse = chart.inverse(to);
        if (!inverse) return 0.0;
        return std::exp(step.log_density(inverse->delta, scale) + inverse->log_jacobian);
      };
      EXPECT_GT(chi_square_directions(grid, 20000, draw, density).p_value, significance);
    }
  }
}

/// prepare_step, with the chart's tangents turned by random angles.
ChainState turned_state(const Scene& scene, const KernelOptions& options,
                        const PathTopology& topology, const PathCoordinates& coordinates,
                        Rng& rng) {
  ChainState state;
  state.topology = topology;
  state.coordinates = coordinates;
  state.chart = Chart(scene, topology, coordinates);
  for (int k = 0; k < state.chart.block_count(); ++k)
    state.chart.rotate(k, 2.0 * kPi * rng.uniform());
  PathDerivatives derivatives;
  differentiate(scene, topology, state.chart, {}, derivatives);
  const Vector div = divergence(scene, topology, state.chart);
  state.step =
      StepDistribution(options, state.chart.dimension(), CholeskyFactor::of(derivatives.q).value(),
                       &derivatives.gradient, &div);
  return state;
}

// Law: the density of a step between two paths of a real scene, with the full drift, does not see
// the choice of tangents.
TEST(StepDistribution, InvariantUnderRotationsOfTheBases) {
  Rng rng(30, Stream::Test, 0);
  KernelOptions options = options_of(Drift::Full);
  int compared = 0;
  for (const TestScene& test : test_scenes()) {
    for (const PathSampler::Sample& path : light_paths(test, 100, 30)) {
      ChainState from;
      from.topology = path.topology;
      from.coordinates = path.coordinates;
      prepare_step(test.scene, options, from);
      const double scale = 0.3;
      const PathCoordinates to = from.chart.retract(from.step.sample(scale, rng));
      const ChainState turned =
          turned_state(test.scene, options, path.topology, path.coordinates, rng);
      const auto there = from.chart.inverse(to);
      const auto turned_there = turned.chart.inverse(to);
      ASSERT_TRUE(there.has_value());
      ASSERT_TRUE(turned_there.has_value());
      const double density = from.step.log_density(there->delta, scale) + there->log_jacobian;
      const double turned_density =
          turned.step.log_density(turned_there->delta, scale) + turned_there->log_jacobian;
      if (!std::isfinite(density)) continue;
      ++compared;
      // The divergence comes from differences, good to about 1e-5 of itself.
      EXPECT_NEAR(density, turned_density, 1e-4 * (1.0 + std::abs(density))) << test.name;
    }
  }
  EXPECT_GT(compared, 390);
}

}  // namespace
}  // namespace driftlight::test
