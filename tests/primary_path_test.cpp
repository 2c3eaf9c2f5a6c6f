// SPDX-License-Identifier: Apache-2.0
/// A path as a function of its numbers: the walk is the tracer's path, warps have their densities,
/// and derivatives are those of the target.
#include "primary_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "bsdf_warp.h"
#include "driftlight/finite_difference.h"
#include "emission_warp.h"
#include "strategy_target.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

struct Found {
  StrategyNumbers numbers;
  PrimaryPath path;
  double target;
};

/// Points that carry light, at paths of 1 to 6 edges, at most `count` of each strategy.
std::vector<Found> found_paths(const Scene& scene, int count, int tries, std::uint64_t seed) {
  const EmissionGuide unguided(scene);
  StrategyTarget target(scene, unguided, 1, 6);
  PrimaryPlace place;
  std::map<std::pair<int, int>, int> counts;
  std::vector<Found> result;
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(tries); ++i) {
    Rng rng(seed, Stream::Test, i);
    const StrategyNumbers numbers(1 + static_cast<int>(i % 6), target.has_lens(), rng);
    const auto [s, t] = numbers.strategy();
    if (counts[{s, t}] >= count) continue;
    const auto path = target(numbers, numbers.strategy(), place);
    if (!path) continue;
    ++counts[{s, t}];
    result.push_back({numbers, *path, place.target});
  }
  return result;
}

/// Law: the walk in primary coordinates is the path of the tracer, and log f - log sum p its
/// target.
TEST(PrimaryPath, WalkHasTheTargetOfTheTracer) {
  std::set<std::pair<PathEnd, bool>> ends;
  for (const TestScene& test : test_scenes()) {
    const EmissionGuide unguided(test.scene);
    const PrimaryFunction function(test.scene, unguided);
    std::set<std::pair<int, int>> strategies;
    int count = 0;
    for (const Found& found : found_paths(test.scene, 12, 6000, 11)) {
      const auto [s, t] = found.path.strategy;
      const double expected = std::log(found.target);
      const double y = function.log_target(found.numbers, found.path);
      EXPECT_NEAR(y, expected, 1e-6 * (1.0 + std::abs(expected))) << test.name << s << ' ' << t;
      strategies.emplace(s, t);
      ends.emplace(found.path.topology.end, found.path.topology.has_light_side());
      ++count;
    }
    EXPECT_GT(count, 40) << test.name;
    EXPECT_GT(strategies.size(), 10U) << test.name;
  }
  // Each way to end; an environment also with a light side.
  EXPECT_EQ(ends.size(), 9U);
}

/// Law: a sample brings what its strategies bring one by one, and the path drawn from it is that of
/// its strategy, as often as its share is. Paths may be shorter than what the numbers have room
/// for.
TEST(PrimaryPath, SampleIsTheSumOfItsStrategies) {
  for (const TestScene& test : test_scenes()) {
    const EmissionGuide unguided(test.scene);
    StrategyTarget target(test.scene, unguided, 2, 6);
    PrimaryPlace sample;
    PrimaryPlace place;
    double surprise = 0;
    int count = 0;
    for (std::uint64_t i = 0; i < 1500; ++i) {
      Rng rng(17, Stream::Test, i);
      const StrategyNumbers numbers(6, target.has_lens(), rng);
      const auto choice = target.sample(numbers, rng, sample);
      std::vector<double> parts;
      double chosen = 0;
      for (int edges = 2; edges <= 6; ++edges) {
        for (int s = 0; s <= edges; ++s) {
          const Strategy strategy{s, edges + 1 - s};
          const auto path = target(numbers, strategy, place);
          parts.push_back(place.target);
          if (!choice || choice->path.strategy != strategy) continue;
          ASSERT_TRUE(path) << test.name;
          chosen = place.target;
          EXPECT_NEAR(chosen, sample.splats[choice->splat].luminance, 1e-9 * chosen);
          EXPECT_EQ(path->topology.block_count, choice->path.topology.block_count);
          for (int k = 0; k < path->topology.scatter_count; ++k) {
            const auto at = static_cast<std::size_t>(k);
            EXPECT_EQ(path->topology.vertices[at].delta, choice->path.topology.vertices[at].delta);
          }
        }
      }
      const double sum = std::accumulate(parts.begin(), parts.end(), 0.0);
      ASSERT_NEAR(sample.target, sum, 1e-9 * sum) << test.name;
      ASSERT_EQ(choice.has_value(), sum > 0.0) << test.name;
      if (!choice) continue;
      // The share of what was drawn has the mean sum p^2, and a variance of at most 1/4.
      surprise += chosen / sum;
      for (const double part : parts) surprise -= (part / sum) * (part / sum);
      ++count;
    }
    EXPECT_GT(count, 100) << test.name;
    EXPECT_LT(std::abs(surprise), 4.0 * 0.5 * std::sqrt(count)) << test.name;
  }
}

/// Numbers with one that steers moved by h.
StrategyNumbers displaced(const Found& found, int i, double h) {
  StrategyNumbers numbers = found.numbers;
  numbers.steering(found.path.strategy, i) += h;
  return numbers;
}

/// How far number i may be moved within (0, 1), at most 1e-4.
double room(const Found& found, int i) {
  const double u = found.numbers.steering(found.path.strategy, i);
  return std::min(1e-4, 0.2 * std::min(u, 1.0 - u));
}

/// Counts what agrees: functions that are piecewise smooth have a kink here and there.
class Agreement {
 public:
  void add(double exact, const Derivative& numeric, double scale) {
    if (!(numeric.error < 1e-3 * (scale + std::abs(exact)))) return;
    ++count_;
    const double tolerance = 20.0 * numeric.error + 1e-5 * (scale + std::abs(exact));
    if (std::abs(exact - numeric.value) <= tolerance) ++agreed_;
  }
  int count() const { return count_; }
  double share() const { return static_cast<double>(agreed_) / std::max(count_, 1); }

 private:
  int count_ = 0;
  int agreed_ = 0;
};

TEST(PrimaryPath, GradientIsThatOfDifferences) {
  for (const TestScene& test : test_scenes()) {
    const EmissionGuide unguided(test.scene);
    const PrimaryFunction function(test.scene, unguided);
    Agreement agreement;
    PrimaryDerivatives derivatives;
    for (const Found& found : found_paths(test.scene, 6, 3000, 12)) {
      if (!function.gradient(found.numbers, found.path, derivatives)) continue;
      for (int i = 0; i < derivatives.gradient.size(); ++i) {
        const auto f = [&](double h) {
          return function.log_target(displaced(found, i, h), found.path);
        };
        agreement.add(derivatives.gradient[i], ridders(f, room(found, i)), 1.0);
      }
    }
    EXPECT_GT(agreement.count(), 200) << test.name;
    EXPECT_GT(agreement.share(), 0.99) << test.name;
  }
}

/// A gradient that comes with other derivatives is the one by itself.
void expect_gradient(const PrimaryFunction& function, const Found& found, const Vector& gradient) {
  PrimaryDerivatives alone;
  ASSERT_TRUE(function.gradient(found.numbers, found.path, alone));
  EXPECT_LE((alone.gradient - gradient).norm(), 1e-9 * (1.0 + alone.gradient.norm()));
}

TEST(PrimaryPath, HessianIsThatOfDifferencesOfGradients) {
  for (const TestScene& test : test_scenes()) {
    const EmissionGuide unguided(test.scene);
    const PrimaryFunction function(test.scene, unguided);
    Agreement agreement;
    PrimaryDerivatives derivatives;
    PrimaryDerivatives moved;
    for (const Found& found : found_paths(test.scene, 2, 1500, 13)) {
      if (!function.gradient_and_hessian(found.numbers, found.path, derivatives)) continue;
      expect_gradient(function, found, derivatives.gradient);
      const double scale = derivatives.hessian.cwiseAbs().maxCoeff();
      for (int i = 0; i < derivatives.gradient.size(); i += 3) {
        const int j = (2 * i + 1) % static_cast<int>(derivatives.gradient.size());
        const auto f = [&](double h) {
          function.gradient(displaced(found, i, h), found.path, moved);
          return moved.gradient[j];
        };
        agreement.add(derivatives.hessian(i, j), ridders(f, room(found, i)), 1e-3 * scale + 1e-6);
      }
    }
    EXPECT_GT(agreement.count(), 40) << test.name;
    EXPECT_GT(agreement.share(), 0.98) << test.name;
  }
}

/// Law: the matrix of constraints is that of the differences of their residuals, and of no numbers
/// but those that steer something.
TEST(PrimaryPath, ConstraintsAreThoseOfDifferences) {
  for (const TestScene& test : test_scenes()) {
    const EmissionGuide unguided(test.scene);
    const PrimaryFunction function(test.scene, unguided);
    Agreement agreement;
    PrimaryDerivatives derivatives;
    Rng rng(19, Stream::Test, 0);
    for (const Found& found : found_paths(test.scene, 6, 3000, 18)) {
      if (!function.gradient_and_constraints(found.numbers, found.path, derivatives)) continue;
      expect_gradient(function, found, derivatives.gradient);
      // x^T Q x = 1/9 sum_k w_k (dr_k / dx)^2 along some direction x.
      const int d = static_cast<int>(derivatives.gradient.size());
      Vector x(d);
      double least = 1.0;
      for (int i = 0; i < d; ++i) {
        x[i] = rng.normal();
        least = std::min(least, room(found, i) / (1.0 + std::abs(x[i])));
      }
      const auto at = function.residuals(found.numbers, found.path);
      double numeric = 0;
      double error = 0;
      for (std::size_t k = 0; k < at.size(); ++k) {
        const auto f = [&](double h) {
          StrategyNumbers numbers = found.numbers;
          for (int i = 0; i < d; ++i) numbers.steering(found.path.strategy, i) += h * x[i];
          // Where a lobe has no share of the light any more its residual is gone.
          const auto moved = function.residuals(numbers, found.path);
          return moved.size() == at.size() ? moved[k].value
                                           : std::numeric_limits<double>::quiet_NaN();
        };
        const Derivative slope = ridders(f, least);
        numeric += at[k].precision / 9.0 * slope.value * slope.value;
        error += at[k].precision / 9.0 * 2.0 * std::abs(slope.value) * slope.error;
      }
      agreement.add(x.dot(derivatives.constraints * x), {numeric, error}, 1.0);
    }
    EXPECT_GT(agreement.count(), 40) << test.name;
    EXPECT_GT(agreement.share(), 0.98) << test.name;
  }
}

using Jet2 = ceres::Jet<double, 2>;

/// |dv / du1 x dv / du2|
double area_of(const Vec3<Jet2>& v) {
  const auto along = [&](int k) { return Vec3d(v.x().v[k], v.y().v[k], v.z().v[k]); };
  return along(0).cross(along(1)).norm();
}

Vec3<Jet2> seeded(const Vec3d& u) { return {Jet2(u.x(), 0), Jet2(u.y(), 1), Jet2(u.z())}; }

/// Law: a warp of density p magnifies areas by 1 / p, here p of the lobe taken: the density by
/// which it is drawn, times the probability of the lobe.
TEST(BsdfWarp, LobesMagnifyByTheirDensity) {
  const Texture white(Rgbd::Ones());
  const Texture half(Rgbd::Constant(0.5));
  const Microfacets beckmann{Distribution::Beckmann, 0.2};
  const Microfacets ggx{Distribution::Ggx, 0.3};
  const RoughDielectric glass{ggx, 1.5, white, white};
  const Phong phong{Texture(Rgbd::Zero()), white, 30};
  const std::vector<Bsdf> bsdfs{Diffuse{half},
                                RoughConductor{beckmann},
                                RoughConductor{ggx},
                                RoughDielectric{beckmann, 1.5, white, white},
                                glass,
                                phong,
                                Phong{half, Texture(Rgbd::Zero()), 30}};
  const SurfacePoint<double> at{Vec3d(0.3, -0.5, 0.8).normalized(), Vec2d(0.4, 0.3),
                                Vec3d(1.2, 0.5, -0.1)};
  const SurfacePoint<Jet2> at_jets{constant<Jet2>(at.n), constant<Jet2>(at.uv),
                                   constant<Jet2>(at.tangent)};
  Rng rng(14, Stream::Test, 0);
  std::array<int, 2> sides{};
  for (const Bsdf& bsdf : bsdfs) {
    for (int i = 0; i < 300; ++i) {
      Vec3d wi = square_to_sphere(rng.uniform(), rng.uniform());
      if (!is_transmissive(bsdf) && at.n.dot(wi) < 0.0) wi = -wi;
      const Vec3d u = rng.uniform3();
      const auto next = sample(bsdf, at, wi, u);
      const auto jets = warp<Jet2>(bsdf, at_jets, constant<Jet2>(wi), seeded(u));
      ASSERT_EQ(next.has_value(), jets.has_value());
      if (!next) continue;
      ASSERT_LT((next->wo - value(jets->wo)).norm(), 1e-12);
      double share = 1.0;
      if (const auto* rough = std::get_if<RoughDielectric>(&bsdf)) {
        const double eta = at.n.dot(wi) > 0.0 ? rough->eta : 1.0 / rough->eta;
        const bool reflection = next->scattering == Scattering::Reflection;
        ++sides[reflection ? 0 : 1];
        const Vec3d h = (wi + (reflection ? 1.0 : eta) * next->wo).normalized();
        const double fresnel = fresnel_dielectric(std::abs(wi.dot(h)), eta);
        share = reflection ? fresnel : 1.0 - fresnel;
      }
      EXPECT_NEAR(area_of(jets->wo) * pdf(bsdf, at, wi, next->wo) / share, 1.0, 1e-6) << i;
    }
  }
  EXPECT_GT(std::min(sides[0], sides[1]), 50);
}

TEST(EmissionWarp, PointsAndDirectionsMagnifyByTheirDensity) {
  Rng rng(15, Stream::Test, 0);
  std::set<std::size_t> kinds;
  for (const TestScene& test : test_scenes()) {
    for (const Emitter& emitter : test.scene.emitters()) {
      for (int i = 0; i < 50; ++i) {
        const Vec3<Jet2> u = seeded(rng.uniform3());
        double density = 0;
        Vec3<Jet2> y;
        if (const auto* area = std::get_if<AreaEmitter>(&emitter)) {
          const Shape& shape = test.scene.shapes()[area->shape];
          y = warp_area(shape, u.x(), u.y()).p;
          density = 1.0 / shape.extent.area;
        } else if (is_environment(emitter)) {
          y = warp_environment(emitter, u.x(), u.y());
          const auto* map = std::get_if<EnvironmentMap>(&emitter);
          density = map != nullptr ? map->pdf(value(y)) : 0.25 * kInvPi;
        } else if (const auto* spot = std::get_if<SpotEmitter>(&emitter)) {
          y = spot->sample(u.x(), u.y());
          density = spot->falloff(value(y)) / spot->solid_angle();
          EXPECT_LT((value(y) - spot->sample(value(u.x()), value(u.y()))).norm(), 1e-12);
        } else {
          continue;
        }
        kinds.insert(emitter.index());
        // Interpolated meshes are flat for the sampler: their areas are those of their triangles.
        EXPECT_NEAR(area_of(y) * density, 1.0, 1e-6) << test.name << emitter.index();
      }
    }
  }
  EXPECT_EQ(kinds.size(), 4U);
}

}  // namespace
}  // namespace driftlight::test
