// SPDX-License-Identifier: Apache-2.0
/// Laws of the Gaussian steps of h2mc and lmc. That their images are right is for the slow tests.
#include "gaussian_step.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "gradient_cache.h"
#include "primary_sample.h"
#include "support/chi_square.h"
#include "support/t_test.h"

namespace driftlight::test {
namespace {

Matrix symmetric(int d, Rng& rng) {
  Matrix a(d, d);
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) a(i, j) = rng.normal();
  return Matrix(a + a.transpose());
}

Vector normals(int d, Rng& rng) {
  Vector v(d);
  for (int i = 0; i < d; ++i) v[i] = rng.normal();
  return v;
}

/// Law: log_density is that of sample. Importance weights of a wider density of both average to 1,
/// and 2 (max - log_density) of samples has the chi^2 distribution.
TEST(GaussianStep, SampleHasItsDensity) {
  Rng rng(1, Stream::Test, 0);
  const int d = 3;
  const Matrix hessian = 40.0 * symmetric(d, rng);
  const Vector gradient = 5.0 * normals(d, rng);
  const Vector m = normals(d, rng).cwiseAbs();
  for (const GaussianStep& step :
       {GaussianStep::hamiltonian(gradient, hessian, 0.3),
        GaussianStep::langevin(gradient, m, 0.1, 0.3), GaussianStep::isotropic(d, 0.2)}) {
    const GaussianStep wide = GaussianStep::isotropic(d, 0.5);
    Moments weights;
    const auto size = static_cast<std::size_t>(d);
    std::vector<Moments> moments(2 * size);
    std::vector<Moments> expected(2 * size);
    for (int i = 0; i < 40000; ++i) {
      const Vector x = wide.sample(rng);
      const double w = std::exp(step.log_density(x) - wide.log_density(x));
      weights.add(w);
      const Vector y = step.sample(rng);
      for (std::size_t k = 0; k < size; ++k) {
        const auto i0 = static_cast<int>(k);
        const int i1 = (i0 + 1) % d;
        moments[k].add(y[i0]);
        moments[size + k].add(y[i0] * y[i1]);
        expected[k].add(w * x[i0]);
        expected[size + k].add(w * x[i0] * x[i1]);
      }
    }
    const double level = sidak(0.01, 3 * (2 * d + 1));
    EXPECT_GT(student_p_value(weights, 1.0), level) << weights.mean();
    for (std::size_t k = 0; k < 2 * size; ++k)
      EXPECT_GT(welch_p_value(moments[k], expected[k]), level) << k;
  }
}

/// Law: with no prior to speak of a Gaussian target is drawn from exactly, so that every step is
/// accepted: I(u) N_u(d) = I(u + d) N_(u + d)(-d).
TEST(GaussianStep, HamiltonianIsExactForGaussians) {
  Rng rng(2, Stream::Test, 0);
  for (const int d : {2, 6, 12}) {
    const Matrix a = symmetric(d, rng);
    const Matrix hessian = -(a * a.transpose() + 0.1 * Matrix::Identity(d, d));
    const Vector u = normals(d, rng);
    const auto step_at = [&](const Vector& x) {
      return GaussianStep::hamiltonian(hessian * x, hessian, 1e6);
    };
    const auto log_target = [&](const Vector& x) { return 0.5 * x.dot(hessian * x); };
    for (int i = 0; i < 10; ++i) {
      const Vector offset = step_at(u).sample(rng);
      const Vector to = u + offset;
      EXPECT_NEAR(log_target(u) + step_at(u).log_density(offset),
                  log_target(to) + step_at(to).log_density(-offset), 1e-7 * (1.0 + to.norm()));
    }
  }
}

/// Law: where the target curves upward too the offset is where Hamilton's equations lead in the
/// time pi / 2: q' = p / |l|, p' = g + l q, solved here by the rule of Runge and Kutta.
TEST(GaussianStep, HamiltonianFollowsTheEquations) {
  for (const double l : {-30.0, -2.0, 0.7, 50.0}) {
    const double g = 1.7;
    const auto end_of = [&](double p) {
      double q = 0;
      const int steps = 2000;
      const double dt = 0.5 * kPi / steps;
      for (int i = 0; i < steps; ++i) {
        const double inverse = 1.0 / std::abs(l);
        const double k1q = p * inverse;
        const double k1p = g + l * q;
        const double k2q = (p + 0.5 * dt * k1p) * inverse;
        const double k2p = g + l * (q + 0.5 * dt * k1q);
        const double k3q = (p + 0.5 * dt * k2p) * inverse;
        const double k3p = g + l * (q + 0.5 * dt * k2q);
        const double k4q = (p + dt * k3p) * inverse;
        const double k4p = g + l * (q + dt * k3q);
        q += dt / 6.0 * (k1q + 2.0 * k2q + 2.0 * k3q + k4q);
        p += dt / 6.0 * (k1p + 2.0 * k2p + 2.0 * k3p + k4p);
      }
      return q;
    };
    const double mean = end_of(0.0);
    const double deviation = end_of(std::sqrt(std::abs(l))) - mean;
    const Vector gradient = Vector::Constant(1, g);
    const Matrix hessian = Matrix::Constant(1, 1, l);
    const GaussianStep step = GaussianStep::hamiltonian(gradient, hessian, 1e6);
    const auto log_normal = [&](double x) {
      return -0.5 * std::pow((x - mean) / deviation, 2) -
             std::log(deviation * std::sqrt(2.0 * kPi));
    };
    for (const double x : {-0.3, 0.0, 0.2, 1.0})
      EXPECT_NEAR(step.log_density(Vector::Constant(1, x)), log_normal(x), 1e-6) << l << ' ' << x;
  }
}

/// A smooth density over the torus [0, 1)^2, with a narrow ridge.
double log_toy(const Vector& u) {
  return 3.0 * std::sin(2.0 * kPi * (u[0] + u[1])) + std::cos(4.0 * kPi * u[0]);
}
void derive_toy(const Vector& u, Vector& gradient, Matrix& hessian) {
  const double a = 2.0 * kPi;
  const double c = 3.0 * a * std::cos(a * (u[0] + u[1]));
  const double s = -3.0 * a * a * std::sin(a * (u[0] + u[1]));
  gradient = Vector::Constant(2, c);
  gradient[0] -= 2.0 * a * std::sin(2.0 * a * u[0]);
  hessian = Matrix::Constant(2, 2, s);
  hessian(0, 0) -= 4.0 * a * a * std::cos(2.0 * a * u[0]);
}

/// Law: steps with the ratio of Hastings, modulo 1, keep the law of the target. Points are drawn
/// from it by rejection, moved a few times, and then tested for it in cells.
void expect_stationary(const std::function<GaussianStep(const Vector&)>& step_at,
                       std::uint64_t seed) {
  Rng rng(seed, Stream::Test, 0);
  constexpr int kCells = 6;
  std::vector<double> observed(kCells * kCells, 0.0);
  std::vector<double> expected(kCells * kCells, 0.0);
  double accepted = 0;
  constexpr int kPoints = 20000;
  for (int i = 0; i < kPoints; ++i) {
    Vector u(2);
    do {
      u << rng.uniform(), rng.uniform();
    } while (rng.uniform() > std::exp(log_toy(u) - 4.0));
    for (int k = 0; k < 4; ++k) {
      const GaussianStep forward = step_at(u);
      const Vector offset = forward.sample(rng);
      Vector to = u + offset;
      to << wrapped(to[0]), wrapped(to[1]);
      const double log_ratio =
          log_toy(to) - log_toy(u) + step_at(to).log_density(-offset) - forward.log_density(offset);
      accepted += std::min(1.0, std::exp(log_ratio)) / (4.0 * kPoints);
      if (rng.uniform() < std::exp(log_ratio)) u = to;
    }
    const auto cell = [](double x) { return static_cast<std::size_t>(x * kCells); };
    observed[cell(u[0]) * kCells + cell(u[1])] += 1.0;
  }
  double total = 0;
  for (std::size_t c = 0; c < expected.size(); ++c) {
    const double x = static_cast<double>(c / kCells) / kCells;
    const double y = static_cast<double>(c % kCells) / kCells;
    const auto density = [](double a, double b) {
      Vector u(2);
      u << a, b;
      return std::exp(log_toy(u));
    };
    expected[c] = integrate(density, x, x + 1.0 / kCells, y, y + 1.0 / kCells, 1e-8);
    total += expected[c];
  }
  for (double& e : expected) e *= kPoints / total;
  EXPECT_GT(chi_square(observed, expected).p_value, 1e-3);
  EXPECT_GT(accepted, 0.3);
}

TEST(GaussianStep, HamiltonianKeepsTheTarget) {
  expect_stationary(
      [](const Vector& u) {
        Vector gradient;
        Matrix hessian;
        derive_toy(u, gradient, hessian);
        return GaussianStep::hamiltonian(gradient, hessian, 0.5);
      },
      4);
}

/// With the memory of another chain, and with none.
TEST(GradientMemory, KeepsTheTarget) {
  LmcOptions options;
  options.step = 0.1;
  options.sigma = 0.3;
  const auto bounded_gradient = [&](const Vector& u) {
    Vector gradient;
    Matrix hessian;
    derive_toy(u, gradient, hessian);
    return GradientMemory::bounded(gradient, options);
  };
  GradientMemory memory;
  for (std::uint64_t run = 0; run < 2; ++run) {
    expect_stationary(
        [&](const Vector& u) { return memory.moments(bounded_gradient(u), options).step(options); },
        5 + run);
    memory.add((Vector(2) << 12.0, -3.0).finished(), options);
    memory.add((Vector(2) << 9.0, 1.0).finished(), options);
  }
}

/// Law: adaptation diminishes. What one more gradient changes of a step falls off as t^-decay.
TEST(GradientMemory, ForgetsToLearn) {
  const LmcOptions options;
  GradientMemory memory;
  Rng rng(7, Stream::Test, 0);
  const Vector here = Vector::Constant(4, 3.0);
  const Vector offset = Vector::Constant(4, 0.01);
  const auto change = [&] {
    const auto density = [&] {
      return memory.moments(here, options).step(options).log_density(offset);
    };
    const double before = density();
    memory.add(Vector(10.0 * normals(4, rng)), options);
    return std::abs(density() - before);
  };
  double early = 0;
  for (int t = 0; t < 10; ++t) early += change() / 10.0;
  for (int t = 0; t < 5000; ++t) change();
  double late = 0;
  for (int t = 0; t < 10; ++t) late += change() / 10.0;
  EXPECT_GT(early, 0.0);
  EXPECT_LT(late, 0.03 * early);
}

/// The moments of points nearby, of as many as are kept, and of their own strategy.
TEST(GradientCache, RemembersWhatIsNear) {
  LmcOptions options;
  options.cache = 3;
  const Strategy strategy{1, 2};
  const auto point = [](const Strategy& of, double x, double direction) {
    return GradientCache::Point{
        of,
        Vector::Constant(2, x),
        {Vector::Constant(2, direction), Vector::Constant(2, direction * direction)}};
  };
  const GradientCache cache(
      {point(strategy, 0.5, 4.0), point(strategy, 0.501, 6.0), point({2, 1}, 0.5, 9.0),
       point(strategy, 0.7, 1.0), point(strategy, 0.9, 2.0)},
      options);
  const Vector offset = Vector::Constant(2, 0.003);
  const auto density = [&](const Strategy& of, double x) {
    return cache.step(of, Vector::Constant(2, x)).log_density(offset);
  };
  const auto expected = [&](double direction, double square) {
    const GradientMoments moments{Vector::Constant(2, direction), Vector::Constant(2, square)};
    return moments.step(options).log_density(offset);
  };
  EXPECT_DOUBLE_EQ(density(strategy, 0.5), expected(5.0, 26.0));
  EXPECT_DOUBLE_EQ(density(strategy, 0.7), expected(1.0, 1.0));
  EXPECT_DOUBLE_EQ(density({2, 1}, 0.505), expected(9.0, 81.0));
  const double isotropic = GaussianStep::isotropic(2, options.sigma).log_density(offset);
  EXPECT_DOUBLE_EQ(density(strategy, 0.52), isotropic);
  EXPECT_DOUBLE_EQ(density(strategy, 0.9), isotropic);
  EXPECT_DOUBLE_EQ(density({0, 3}, 0.5), isotropic);
}

/// Points from anywhere, as those of a pilot.
TEST(GradientCache, KeepsTheTarget) {
  LmcOptions options;
  options.step = 0.1;
  options.sigma = 0.3;
  options.cache = 2000;
  const Strategy strategy{0, 2};
  GradientMemory memory;
  std::vector<GradientCache::Point> points;
  Rng rng(8, Stream::Test, 0);
  for (int i = 0; i < options.cache; ++i) {
    Vector u(2);
    u << rng.uniform(), rng.uniform();
    Vector gradient;
    Matrix hessian;
    derive_toy(u, gradient, hessian);
    memory.add(gradient, options);
    points.push_back({strategy, u, memory.moments(gradient, options)});
  }
  const GradientCache cache(points, options);
  expect_stationary([&](const Vector& u) { return cache.step(strategy, u); }, 9);
}

TEST(GradientMemory, CutsLongGradients) {
  LmcOptions options;
  options.gradient_bound = 5.0;
  const Vector g = (Vector(2) << 30.0, 40.0).finished();
  EXPECT_NEAR((GradientMemory::bounded(g, options) - 0.1 * g).norm(), 0.0, 1e-12);
  EXPECT_EQ(GradientMemory::bounded(Vector(0.01 * g), options), Vector(0.01 * g));
}

}  // namespace
}  // namespace driftlight::test
