// SPDX-License-Identifier: Apache-2.0
/// Laws of the Langevin kernel as a Markov chain, on targets with closed forms: detailed balance,
/// the right stationary law with Hastings, and what the divergence does without.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "driftlight/chain.h"
#include "driftlight/kernel.h"
#include "support/dense.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

const std::vector<Drift> kDrifts{Drift::None, Drift::Gradient, Drift::Full};

std::string name(Drift drift) {
  return drift == Drift::None ? "none" : drift == Drift::Gradient ? "gradient" : "full";
}

StepDistribution step_of(const KernelOptions& options, const Matrix& q, const Vector& gradient,
                         const Vector& divergence_of_inverse) {
  return {options, static_cast<int>(q.rows()), CholeskyFactor::of(q).value(),
          options.drift == Drift::None ? nullptr : &gradient,
          options.drift == Drift::Full ? &divergence_of_inverse : nullptr};
}

// ---- A Gaussian in R^3 ------------------------------------------------------------------------

/// N(0, S) with Q(x) = S^-1 s(x), s(x) = 1 + 0.9 sin(c.x), so that the kernel changes from place to
/// place.
class GaussianTarget {
 public:
  using Point = Vector;

  struct State {
    Point x;
    double log_target;
    StepDistribution step;

    Point move(const Vector& delta) const { return x + delta; }
    std::optional<Chart::Inverse> inverse(const Point& to) const {
      return Chart::Inverse{to - x, 0.0};
    }
  };

  GaussianTarget() {
    const Matrix a{{1.0, 0.0, 0.0}, {0.6, 0.7, 0.0}, {-0.3, 0.4, 0.5}};
    factor_ = a;
    covariance_ = a * a.transpose();
    precision_ = inverse(covariance_);
    wave_ = Vector::Zero(3);
    wave_ << 0.9, 0.8, -0.5;
  }

  /// A point of the target itself, to start from.
  Point draw(Rng& rng) const {
    Vector xi(3);
    for (int i = 0; i < 3; ++i) xi[i] = rng.normal();
    return factor_ * xi;
  }

  State prepare(const KernelOptions& options, const Point& x) const {
    const double phase = wave_.dot(x);
    const double s = 1.0 + 0.9 * std::sin(phase);
    const Vector gradient = precision_ * x;
    // div (S / s) = -S grad s / s^2
    const Vector div = covariance_ * wave_ * (-0.9 * std::cos(phase) / (s * s));
    return {x, -0.5 * x.dot(gradient), step_of(options, precision_ * s, gradient, div)};
  }

  /// Functions of the point with their expectations.
  struct Observable {
    std::string name;
    std::function<double(const Point&)> f;
    double expected;
  };
  std::vector<Observable> observables() const {
    std::vector<Observable> result;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j)
        result.push_back(
            {"x_i x_j", [i, j](const Point& x) { return x[i] * x[j]; }, covariance_(i, j)});
    // E[exp(i c.x)] = exp(-c.S c / 2)
    const Vector c = wave_;
    const double decay = std::exp(-0.5 * c.dot(covariance_ * c));
    result.push_back({"sin", [c](const Point& x) { return std::sin(c.dot(x)); }, 0.0});
    result.push_back({"cos", [c](const Point& x) { return std::cos(c.dot(x)); }, decay});
    return result;
  }

 private:
  Matrix factor_, covariance_, precision_;
  Vector wave_;
};

// ---- A product of spheres ---------------------------------------------------------------------

/// Two directions with the von Mises-Fisher densities exp(k m.v) and a Q that couples them and
/// changes from place to place: 1/9 w(X) (S J)^T (S J) + floor, J = dX / d delta, S a constant 6 x
/// 6 matrix, w(X) = exp(a.v_0 + b.v_1). Its divergence is taken by differences in the chart.
class SphereTarget {
 public:
  using Point = PathCoordinates;

  struct State {
    Point x;
    double log_target;
    Chart chart;
    StepDistribution step;

    Point move(const Vector& delta) const { return chart.retract(delta); }
    std::optional<Chart::Inverse> inverse(const Point& to) const { return chart.inverse(to); }
  };

  SphereTarget() : kappa_{3.0, 1.2} {
    Rng rng(51, Stream::Test, 0);
    for (Vec3d& m : mean_) m = square_to_sphere(rng.uniform(), rng.uniform());
    mixing_ = 1.6 * Mixing::Identity() +
              0.5 * Mixing::NullaryExpr([&](Eigen::Index, Eigen::Index) { return rng.normal(); });
    topology_.block_count = 2;
    topology_.end = PathEnd::Environment;
  }

  /// By inversion: m.v = 1 + log(u + (1 - u) exp(-2 k)) / k.
  Point draw(Rng& rng) const {
    Point x;
    for (int k = 0; k < 2; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const double u = rng.uniform();
      const double z = 1.0 + std::log(u + (1.0 - u) * std::exp(-2.0 * kappa_[i])) / kappa_[i];
      const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
      const double phi = 2.0 * kPi * rng.uniform();
      x(k) = to_world({r * std::cos(phi), r * std::sin(phi), z}, mean_[i]);
    }
    return x;
  }

  State prepare(const KernelOptions& options, const Point& x) const {
    const Chart chart(test_scenes().front().scene, topology_, x);
    double log_target = 0;
    Vector gradient(4);
    for (int k = 0; k < 2; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const Vec3d force = kappa_[i] * mean_[i];
      log_target += force.dot(x(k));
      gradient[2 * k] = -force.dot(chart.block(k).t);
      gradient[2 * k + 1] = -force.dot(chart.block(k).b);
    }
    const Vector div = options.drift == Drift::Full ? divergence(chart) : Vector::Zero(4);
    return {x, log_target, chart, step_of(options, matrix(chart, Vector::Zero(4)), gradient, div)};
  }

  struct Observable {
    std::string name;
    std::function<double(const Point&)> f;
    double expected;
  };
  std::vector<Observable> observables() const {
    std::vector<Observable> result;
    for (int k = 0; k < 2; ++k) {
      const double kappa = kappa_[static_cast<std::size_t>(k)];
      const Vec3d m = mean_[static_cast<std::size_t>(k)];
      const Vec3d side = tangent_basis(m).t;
      // Langevin's function: E[m.v] = coth k - 1 / k, E[(m.v)^2] = 1 - 2 E[m.v] / k.
      const double first = 1.0 / std::tanh(kappa) - 1.0 / kappa;
      const double second = 1.0 - 2.0 * first / kappa;
      result.push_back({"m.v", [=](const Point& x) { return m.dot(x(k)); }, first});
      result.push_back(
          {"(m.v)^2", [=](const Point& x) { return std::pow(m.dot(x(k)), 2); }, second});
      result.push_back({"t.v", [=](const Point& x) { return side.dot(x(k)); }, 0.0});
      result.push_back({"(t.v)^2", [=](const Point& x) { return std::pow(side.dot(x(k)), 2); },
                        0.5 * (1.0 - second)});
    }
    const double product = result[0].expected * result[4].expected;
    const auto f0 = result[0].f;
    const auto f1 = result[4].f;
    result.push_back({"m.v m.v", [=](const Point& x) { return f0(x) * f1(x); }, product});
    return result;
  }

 private:
  using Mixing = Eigen::Matrix<double, 6, 6>;

  Matrix matrix(const Chart& chart, const Vector& delta) const {
    using J = ceres::Jet<double, 4>;
    Eigen::Matrix<double, 6, 4> jacobian;
    Vec3d at[2];
    for (int k = 0; k < 2; ++k) {
      const Vec3<J> v = chart.retract(k, J(delta[2 * k], 2 * k), J(delta[2 * k + 1], 2 * k + 1));
      at[k] = value(v);
      for (int i = 0; i < 3; ++i) jacobian.row(3 * k + i) = v[i].v;
    }
    const double w = std::exp(Vec3d(0.8, -0.4, 0.5).dot(at[0]) + Vec3d(0.3, 0.7, 0.2).dot(at[1]));
    const Eigen::Matrix<double, 6, 4> rows = mixing_ * jacobian;
    return w / 9.0 * rows.transpose() * rows + kInvPi * kInvPi * Matrix::Identity(4, 4);
  }

  /// div(Q^-1)_i = sum_j d_j (Q^-1)_ij
  Vector divergence(const Chart& chart) const {
    const double h = 1e-4;
    Vector sum = Vector::Zero(4);
    for (int j = 0; j < 4; ++j) {
      const Vector delta = h * Vector::Unit(4, j);
      const Eigen::Matrix4d plus = matrix(chart, delta);
      const Eigen::Matrix4d minus = matrix(chart, -delta);
      sum += (plus.inverse() - minus.inverse()).col(j) / (2.0 * h);
    }
    return sum;
  }

  std::array<double, 2> kappa_;
  std::array<Vec3d, 2> mean_;
  Mixing mixing_;
  PathTopology topology_;
};

// ---- Chains -----------------------------------------------------------------------------------

/// log p(to | from) at a scale; -infinity beyond the horizon.
template <class State, class Point>
double log_pdf(const State& from, const StepDistribution& step, const Point& to, double scale) {
  const auto inverse = from.inverse(to);
  if (!inverse) return -std::numeric_limits<double>::infinity();
  return step.log_density(inverse->delta, scale) + inverse->log_jacobian;
}

enum class Reverse { Right, Wrong };

/// Means of the observables over one chain that starts in the target. A wrong chain takes the step
/// distribution of the current state for the way back too, as if the kernel were symmetric.
template <class Target>
std::vector<double> run_chain(const Target& target, const KernelOptions& options, Reverse reverse,
                              int steps, Rng& rng) {
  const auto observables = target.observables();
  std::vector<double> sums(observables.size());
  auto state = target.prepare(options, target.draw(rng));
  for (int i = 0; i < steps; ++i) {
    const double scale = draw_scale(options, rng);
    const auto to = target.prepare(options, state.move(state.step.sample(scale, rng)));
    const double forward = log_pdf(state, state.step, to.x, scale);
    const double backward =
        log_pdf(to, reverse == Reverse::Right ? to.step : state.step, state.x, scale);
    const double acceptance =
        std::exp(log_acceptance(state.log_target, to.log_target, forward, backward));
    if (rng.uniform() < acceptance) state = to;
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += observables[k].f(state.x);
  }
  for (double& sum : sums) sum /= steps;
  return sums;
}

/// How a second step is accepted after a refused first one.
enum class Ghost { Counted, Forgotten };

/// Delayed rejection from x by y and z at a scale: a2, with the ghost's densities or without.
template <class State>
double log_second_acceptance(const State& x, const State& y, const State& z, double scale,
                             double second_scale, Ghost ghost = Ghost::Counted) {
  const auto refused = [&](const State& from) {
    const double there = log_pdf(from, from.step, y.x, scale);
    const double back = log_pdf(y, y.step, from.x, scale);
    return log_refused(there, log_acceptance(from.log_target, y.log_target, there, back));
  };
  const bool counted = ghost == Ghost::Counted;
  return log_acceptance(
      x.log_target + (counted ? refused(x) : 0.0), z.log_target + (counted ? refused(z) : 0.0),
      log_pdf(x, x.step, z.x, second_scale * scale), log_pdf(z, z.step, x.x, second_scale * scale));
}

/// As run_chain, with second steps.
template <class Target>
std::vector<double> run_delayed_chain(const Target& target, const KernelOptions& options,
                                      double second_scale, Ghost ghost, int steps, Rng& rng) {
  const auto observables = target.observables();
  std::vector<double> sums(observables.size());
  auto x = target.prepare(options, target.draw(rng));
  for (int i = 0; i < steps; ++i) {
    const double scale = draw_scale(options, rng);
    const auto y = target.prepare(options, x.move(x.step.sample(scale, rng)));
    const double first = log_acceptance(x.log_target, y.log_target, log_pdf(x, x.step, y.x, scale),
                                        log_pdf(y, y.step, x.x, scale));
    if (rng.uniform() < std::exp(first)) {
      x = y;
    } else {
      const auto z = target.prepare(options, x.move(x.step.sample(second_scale * scale, rng)));
      const double second = log_second_acceptance(x, y, z, scale, second_scale, ghost);
      if (rng.uniform() < std::exp(second)) x = z;
    }
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += observables[k].f(x.x);
  }
  for (double& sum : sums) sum /= steps;
  return sums;
}

/// Smallest p-value of the observables over independent chains; run(rng) returns their means.
template <class Target, class Run>
double smallest_p_value_of(const Target& target, int chains, const Run& run) {
  const auto observables = target.observables();
  std::vector<Moments> moments(observables.size());
  for (int chain = 0; chain < chains; ++chain) {
    Rng rng(52, Stream::Test, static_cast<std::uint64_t>(chain));
    const std::vector<double> means = run(rng);
    for (std::size_t k = 0; k < means.size(); ++k) moments[k].add(means[k]);
  }
  double smallest = 1;
  for (std::size_t k = 0; k < moments.size(); ++k)
    smallest = std::min(smallest, student_p_value(moments[k], observables[k].expected));
  return smallest;
}

template <class Target>
double smallest_p_value(const Target& target, const KernelOptions& options, Reverse reverse,
                        int chains, int steps) {
  return smallest_p_value_of(
      target, chains, [&](Rng& rng) { return run_chain(target, options, reverse, steps, rng); });
}

KernelOptions options_of(Drift drift, double scale, double decades) {
  KernelOptions options;
  options.drift = drift;
  options.scale = scale;
  options.scale_decades = decades;
  options.epsilon = 1.0;
  options.safety = 1.0;
  options.time_step_cap = 1.0 / 3.0;
  return options;
}

// Law: Metropolis-Hastings over the Langevin step leaves a known Gaussian as it is, for every
// drift: second moments and waves against closed forms, by Student's test over chains.
TEST(Stationarity, Gaussian) {
  const GaussianTarget target;
  const double significance = sidak(0.01, 3 * static_cast<int>(target.observables().size()));
  for (const Drift drift : kDrifts)
    EXPECT_GT(smallest_p_value(target, options_of(drift, 2.0, 1.0), Reverse::Right, 64, 3000),
              significance)
        << name(drift);
}

// Law: the same on a product of two spheres with von Mises-Fisher densities.
TEST(Stationarity, ProductOfSpheres) {
  const SphereTarget target;
  const double significance = sidak(0.01, 3 * static_cast<int>(target.observables().size()));
  for (const Drift drift : kDrifts)
    EXPECT_GT(smallest_p_value(target, options_of(drift, 1.5, 1.0), Reverse::Right, 48, 600),
              significance)
        << name(drift);
}

// Law: those tests have teeth. A chain whose reverse density is the forward one fails them.
TEST(Stationarity, WrongReverseDensityFails) {
  for (const Drift drift : kDrifts) {
    EXPECT_LT(
        smallest_p_value(GaussianTarget(), options_of(drift, 0.7, 1.0), Reverse::Wrong, 64, 3000),
        1e-8)
        << name(drift);
    EXPECT_LT(
        smallest_p_value(SphereTarget(), options_of(drift, 1.5, 1.0), Reverse::Wrong, 64, 900),
        1e-8)
        << name(drift);
  }
}

// Law: delayed rejection leaves both targets as they are, for every drift.
TEST(Stationarity, DelayedRejection) {
  const GaussianTarget gaussian;
  const SphereTarget spheres;
  const double significance = sidak(
      0.01, 3 * static_cast<int>(gaussian.observables().size() + spheres.observables().size()));
  for (const Drift drift : kDrifts) {
    const KernelOptions wide = options_of(drift, 4.0, 1.0);
    EXPECT_GT(smallest_p_value_of(gaussian, 48,
                                  [&](Rng& rng) {
                                    return run_delayed_chain(gaussian, wide, 0.3, Ghost::Counted,
                                                             2000, rng);
                                  }),
              significance)
        << name(drift);
    EXPECT_GT(smallest_p_value_of(spheres, 48,
                                  [&](Rng& rng) {
                                    return run_delayed_chain(spheres, wide, 0.3, Ghost::Counted,
                                                             400, rng);
                                  }),
              significance)
        << name(drift);
  }
}

// Law: that test has teeth. A second step that takes no account of the first one fails it.
TEST(Stationarity, ForgottenGhostFails) {
  const GaussianTarget target;
  const KernelOptions options = options_of(Drift::None, 3.0, 0.0);
  const auto run = [&](Rng& rng) {
    return run_delayed_chain(target, options, 0.5, Ghost::Forgotten, 3000, rng);
  };
  EXPECT_LT(smallest_p_value_of(target, 64, run), 1e-8);
}

/// pi(x) p(x -> y) a(x -> y) = pi(y) p(y -> x) a(y -> x) for pairs drawn by the kernel.
template <class Target>
void check_detailed_balance(const Target& target) {
  for (const Drift drift : kDrifts) {
    const KernelOptions options = options_of(drift, 1.0, 2.0);
    int certain = 0;
    int doubtful = 0;
    for (std::uint64_t i = 0; i < 500; ++i) {
      Rng rng(53, Stream::Test, i);
      const auto x = target.prepare(options, target.draw(rng));
      const double scale = draw_scale(options, rng);
      const auto y = target.prepare(options, x.move(x.step.sample(scale, rng)));
      const double there = log_pdf(x, x.step, y.x, scale);
      const double back = log_pdf(y, y.step, x.x, scale);
      const double a = log_acceptance(x.log_target, y.log_target, there, back);
      const double b = log_acceptance(y.log_target, x.log_target, back, there);
      ASSERT_LE(a, 0.0);
      ASSERT_LE(b, 0.0);
      EXPECT_EQ(std::max(a, b), 0.0);
      const double flow = x.log_target + there + a;
      EXPECT_NEAR(flow, y.log_target + back + b, 1e-10 * (1.0 + std::abs(flow)));
      ++(a == 0.0 ? certain : doubtful);
    }
    EXPECT_GT(certain, 50);
    EXPECT_GT(doubtful, 50);
  }
}

/// pi(x) p1(y | x) (1 - a1(x, y)) p2(z | x) a2(x, y, z) is the same with x and z exchanged, for
/// ghosts y and pairs drawn by the kernel.
template <class Target>
void check_delayed_balance(const Target& target) {
  constexpr double kSecond = 0.4;
  for (const Drift drift : kDrifts) {
    const KernelOptions options = options_of(drift, 2.0, 1.0);
    int doubtful = 0;
    for (std::uint64_t i = 0; i < 500; ++i) {
      Rng rng(55, Stream::Test, i);
      const auto x = target.prepare(options, target.draw(rng));
      const double scale = draw_scale(options, rng);
      const auto y = target.prepare(options, x.move(x.step.sample(scale, rng)));
      const auto z = target.prepare(options, x.move(x.step.sample(kSecond * scale, rng)));
      const auto flow = [&](const auto& from, const auto& to) {
        const double there = log_pdf(from, from.step, y.x, scale);
        const double back = log_pdf(y, y.step, from.x, scale);
        const double a = log_acceptance(from.log_target, y.log_target, there, back);
        return from.log_target + there + std::log1p(-std::exp(a)) +
               log_pdf(from, from.step, to.x, kSecond * scale) +
               log_second_acceptance(from, y, to, scale, kSecond);
      };
      const double forward = flow(x, z);
      const double reverse = flow(z, x);
      if (!std::isfinite(forward) || !std::isfinite(reverse)) {
        EXPECT_FALSE(std::isfinite(forward) && forward > -600.0);
        EXPECT_FALSE(std::isfinite(reverse) && reverse > -600.0);
        continue;
      }
      ++doubtful;
      EXPECT_NEAR(forward, reverse, 1e-9 * (1.0 + std::abs(forward)));
    }
    EXPECT_GT(doubtful, 50);
  }
}

// Law: the flow between any two states is the same in both directions, by any ghost.
TEST(DetailedBalance, DelayedGaussian) { check_delayed_balance(GaussianTarget()); }
TEST(DetailedBalance, DelayedProductOfSpheres) { check_delayed_balance(SphereTarget()); }

// Law: the flow between any two states is the same in both directions.
TEST(DetailedBalance, Gaussian) { check_detailed_balance(GaussianTarget()); }
TEST(DetailedBalance, ProductOfSpheres) { check_detailed_balance(SphereTarget()); }

// Law: an acceptance is a probability, whatever comes in.
TEST(DetailedBalance, AcceptanceOfDegenerateNumbers) {
  const double inf = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(log_acceptance(0.0, nan, 0.0, 0.0), -inf);
  EXPECT_EQ(log_acceptance(0.0, -inf, 0.0, 0.0), -inf);
  EXPECT_EQ(log_acceptance(0.0, 0.0, 0.0, -inf), -inf);
  EXPECT_EQ(log_acceptance(0.0, 1e9, 0.0, 0.0), 0.0);
  EXPECT_EQ(log_acceptance(-1.0, -3.0, 0.5, 0.75), -1.75);
}

// ---- Without Hastings -------------------------------------------------------------------------

/// The stationary mean of cos 2x of the discretised Langevin equation without Hastings, in one
/// dimension with U = x^2 / 2 and T T* = D(x) = 1 + 0.6 cos 2x, over independent chains.
Moments unadjusted_mean(Drift drift, double time_step) {
  KernelOptions options = options_of(drift, 1.0, 0.0);
  options.epsilon = 1e9;
  options.time_step_cap = time_step;
  Moments result;
  for (std::uint64_t chain = 0; chain < 48; ++chain) {
    Rng rng(54, Stream::Test, chain);
    Vector x(1);
    x[0] = rng.normal();
    double sum = 0;
    const int steps = 15000;
    for (int i = 0; i < steps; ++i) {
      // T T* = c^2 Q^-1 with c^2 = 1/6.
      const double inverse = 6.0 * (1.0 + 0.6 * std::cos(2.0 * x[0]));
      const Vector slope = Vector::Constant(1, -6.0 * 1.2 * std::sin(2.0 * x[0]));
      const StepDistribution step =
          step_of(options, Matrix::Constant(1, 1, 1.0 / inverse), x, slope);
      x += step.sample(1.0, rng);
      sum += std::cos(2.0 * x[0]);
    }
    result.add(sum / steps);
  }
  return result;
}

/// E[cos 2x] under the density exp(-x^2 / 2) D(x)^power.
double mean_under(double power) {
  const auto density = [=](double x) {
    return std::exp(-0.5 * x * x) * std::pow(1.0 + 0.6 * std::cos(2.0 * x), power);
  };
  using Rule = boost::math::quadrature::gauss_kronrod<double, 61>;
  const double mass = Rule::integrate(density, -10.0, 10.0, 10, 1e-10);
  const auto weighted = [&](double x) { return std::cos(2.0 * x) * density(x); };
  return Rule::integrate(weighted, -10.0, 10.0, 10, 1e-10) / mass;
}

// Law: with Hastings off and small dt the stationary law is exp(-U), to O(dt), if the drift has the
// divergence. Without it the law is exp(-U) / D, which is another one.
TEST(Stationarity, DivergenceMakesTheUnadjustedLawRight) {
  const double right = mean_under(0.0);
  EXPECT_NEAR(right, std::exp(-2.0), 1e-9);
  const double wrong = mean_under(-1.0);
  ASSERT_LT(wrong, right - 0.2);
  for (const double dt : {0.01, 0.0025}) {
    const Moments full = unadjusted_mean(Drift::Full, dt);
    EXPECT_NEAR(full.mean(), right, 4.0 * full.error() + 2.0 * dt) << dt;
    const Moments gradient = unadjusted_mean(Drift::Gradient, dt);
    EXPECT_NEAR(gradient.mean(), wrong, 4.0 * gradient.error() + 2.0 * dt) << dt;
    EXPECT_LT(gradient.mean(), right - 6.0 * gradient.error()) << dt;
    EXPECT_LT(full.error() + gradient.error(), 0.05);
  }
}

}  // namespace
}  // namespace driftlight::test
