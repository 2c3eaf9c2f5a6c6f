// SPDX-License-Identifier: Apache-2.0
/// Laws of charts with a light side: they are other coordinates of the same paths, and the only
/// ones of light that comes to a lens straight from a point.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "driftlight/chart_rule.h"
#include "driftlight/contribution.h"
#include "driftlight/factor.h"
#include "driftlight/gradient_check.h"
#include "driftlight/hand_derivatives.h"
#include "driftlight/path_class.h"
#include "driftlight/path_sampler.h"
#include "driftlight/render.h"
#include "driftlight/walk.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Sample = PathSampler::Sample;

/// A floor with a bent mirror, a glass ball and a coarse rough one above it, under a lamp, a point,
/// a spot and parallel light: every emitter that a light side begins at, also behind delta lobes
/// with other normals than the geometric ones.
TestScene lenses() {
  SceneBuilder builder;
  const auto material = [&](Bsdf bsdf) {
    return builder.add_material({builder.add_bsdf(std::move(bsdf)), std::nullopt});
  };
  const auto white = material(Diffuse{Texture(Rgbd{0.7, 0.6, 0.5})});
  const Texture clear(Rgbd{1, 1, 1});
  const Microfacets rough{Distribution::Ggx, 0.3};
  builder.add_shape(quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}, false, 0.3), white);
  builder.add_shape(quad({-1.5, 0, -1.2}, {3, 0, 0}, {0, 1.5, 0}, false, 0.8),
                    material(Conductor{}));
  builder.add_shape(Sphere{{-0.7, 0.6, 0.2}, 0.5}, material(Dielectric{}));
  builder.add_shape(round_mesh({0.9, 0.5, 0.6}, 0.4, 6), material(Dielectric{}));
  builder.add_shape(round_mesh({0.2, 0.5, -0.4}, 0.4, 6),
                    material(RoughDielectric{rough, 1.5, clear, clear}));
  builder.add_shape(Sphere{{0.6, 1.9, 0.0}, 0.15}, white, Rgbd{6, 6, 6});
  builder.add_shape(quad({-0.9, 2.2, -0.2}, {0.4, 0, 0}, {0, 0, 0.4}), white, Rgbd{8, 8, 8});
  builder.add_emitter(PointEmitter{{-0.6, 1.8, 0.3}, {1, 1, 1}});
  builder.add_emitter(SpotEmitter({0.9, 1.7, 0.5}, {0, -1, 0.1}, {2, 2, 2}, 0.6, 0.3));
  builder.add_emitter(DirectionalEmitter{Vec3d(0.2, -1, -0.3).normalized(), {0.5, 0.5, 0.5}});
  builder.set_camera(look_at({0.2, 1.4, 3.2}, {0, 0.4, 0}, 0.6));
  return {"lenses", builder.build(), 6};
}

const std::vector<const TestScene*>& scenes() {
  static const TestScene own = lenses();
  static const std::vector<const TestScene*> all = [] {
    std::vector<const TestScene*> result{&own};
    for (const TestScene& test : test_scenes()) result.push_back(&test);
    return result;
  }();
  return all;
}

PathSampler sampler_of(const TestScene& test, PhaseSpace phase_space) {
  return {test.scene, test.max_depth, LargeSteps::Bdpt, 1, phase_space};
}

Contribution value_of(const TestScene& test, const Sample& path) {
  return contribution(test.scene, path.topology, path.coordinates);
}

/// Calls visit(path) for drawn paths with a light side that carry light.
template <class Visit>
void over_light_sides(const TestScene& test, int attempts, const Visit& visit) {
  const PathSampler sampler = sampler_of(test, PhaseSpace::Bidirectional);
  for (int i = 0; i < attempts; ++i) {
    Rng rng(202, Stream::Test, static_cast<std::uint64_t>(i));
    const auto path = sampler.sample(rng);
    if (!path || !path->topology.has_light_side()) continue;
    if (carries_light(value_of(test, *path).log_target)) visit(*path);
  }
}

/// Positions and lobes of the scattering vertices.
struct Vertices : WalkVisitor<double> {
  std::array<Vec3d, kMaxPathLength> points;
  std::array<Lobe, kMaxPathLength> lobes;
  std::size_t index = 0;

  void vertex(int k) { index = static_cast<std::size_t>(k); }
  void add(const ScatterEvent<double>& e, bool is_delta) {
    points.at(index) = e.at.p;
    lobes.at(index) = lobe_of(e.bsdf, is_delta);
  }
  void scatter(const ScatterEvent<double>& e) { add(e, false); }
  void connect(const ScatterEvent<double>& e) { scatter(e); }
  void delta(const ScatterEvent<double>& e) { add(e, true); }
  void light_scatter(const ScatterEvent<double>& e) { scatter(e); }
  void light_connect(const ScatterEvent<double>& e) { scatter(e); }
  void light_delta(const ScatterEvent<double>& e) { add(e, true); }
};

Vertices vertices_of(const TestScene& test, const PathTopology& topology,
                     const PathCoordinates& coordinates) {
  Vertices vertices;
  walk<double>(test.scene, topology, coordinates, vertices);
  return vertices;
}

double distance(const Vertices& a, const Vertices& b, std::size_t count) {
  double largest = 0;
  for (std::size_t k = 0; k < count; ++k)
    largest = std::max(largest, (a.points.at(k) - b.points.at(k)).norm());
  return largest;
}

// ---- The rule ----

std::optional<int> rule(const TestScene& test, const std::vector<Lobe>& lobes, std::size_t emitter,
                        PhaseSpace space = PhaseSpace::Bidirectional) {
  return light_side(space, test.scene, lobes, static_cast<std::uint32_t>(emitter));
}

// Law: joined is the edge between wide ends nearest to the middle; else the chart of Directions
// stands, if there is one; else the edge nearest to the middle that can be joined.
TEST(ChartRule, IsThatOfItsText) {
  using enum Lobe;
  const TestScene& test = *scenes().front();
  const std::size_t lamp = 0;
  const std::size_t point = 2;
  EXPECT_EQ(rule(test, {}, lamp), 0);
  EXPECT_EQ(rule(test, {}, point), std::nullopt);
  EXPECT_EQ(rule(test, {Wide}, lamp), 0);
  EXPECT_EQ(rule(test, {Wide, Wide}, lamp), 0);
  EXPECT_EQ(rule(test, {Wide, Wide, Wide}, lamp), 0);
  EXPECT_EQ(rule(test, {Wide, Wide, Wide, Wide}, point), 0);
  EXPECT_EQ(rule(test, {Wide, Delta, Delta}, point), 3);
  EXPECT_EQ(rule(test, {Wide, Delta, Delta}, lamp), 3);
  EXPECT_EQ(rule(test, {Wide, Wide, Wide, Delta}, point), 2);
  EXPECT_EQ(rule(test, {Delta, Delta, Wide}, point), 0);
  EXPECT_EQ(rule(test, {Delta, Delta, Wide}, lamp), 0);
  EXPECT_EQ(rule(test, {Narrow}, lamp), 0);
  EXPECT_EQ(rule(test, {Narrow, Narrow}, point), 0);
  EXPECT_EQ(rule(test, {Narrow, Narrow, Delta}, point), 2);
  EXPECT_EQ(rule(test, {Delta, Narrow, Delta}, lamp), 0);
  EXPECT_EQ(rule(test, {Delta, Narrow, Delta}, point), std::nullopt);
  EXPECT_EQ(rule(test, {Wide, Wide, Wide}, lamp, PhaseSpace::Directions), 0);
  EXPECT_EQ(rule(test, {Wide, Delta}, point, PhaseSpace::Directions), std::nullopt);
}

// ---- Tracing and charts ----

// Law: tracing the coordinates of a path gives the path, and a small step there and back as well;
// where it arrives is on a path of the same chart.
TEST(Bidirectional, TraceAndChartsAreInverse) {
  for (const TestScene* test : scenes()) {
    int moved = 0;
    over_light_sides(*test, 300000, [&](const Sample& path) {
      const auto count = static_cast<std::size_t>(path.topology.scatter_count);
      PathTopology again;
      ASSERT_EQ(trace(test->scene, path.topology, path.coordinates, again), TraceStatus::Ok);
      for (std::size_t k = 0; k < count; ++k)
        EXPECT_EQ(again.vertices.at(k).hit, path.topology.vertices.at(k).hit);
      const Chart chart(test->scene, path.topology, path.coordinates);
      Rng rng(203, Stream::Test, static_cast<std::uint64_t>(moved));
      Vector delta(chart.dimension());
      for (double& x : delta) x = 0.02 * rng.normal();
      const PathCoordinates there = chart.retract(delta);
      const auto inverse = chart.inverse(there);
      ASSERT_TRUE(inverse);
      EXPECT_LT((inverse->delta - delta).norm(), 1e-9);
      PathTopology topology;
      if (trace(test->scene, path.topology, there, topology) != TraceStatus::Ok) return;
      ++moved;
      const Vertices vertices = vertices_of(*test, topology, there);
      EXPECT_EQ(light_side(PhaseSpace::Bidirectional, test->scene, {vertices.lobes.data(), count},
                           topology.emitter),
                path.topology.light_count);
      const Chart back(test->scene, topology, there);
      const auto home = back.inverse(path.coordinates);
      ASSERT_TRUE(home);
      EXPECT_LT(distance(vertices_of(*test, topology, back.retract(home->delta)),
                         vertices_of(*test, topology, path.coordinates), count),
                1e-6);
    });
    const bool has_many = test->name == "lenses" || test->name == "room";
    EXPECT_GT(moved, has_many ? 300 : -1) << test->name;
  }
}

// ---- Contribution and density ----

/// Calls visit(directions, bidirectional) with what the same random numbers draw in both spaces.
template <class Visit>
void draw_both(const TestScene& test, int count, const Visit& visit) {
  const PathSampler directions = sampler_of(test, PhaseSpace::Directions);
  const PathSampler bidirectional = sampler_of(test, PhaseSpace::Bidirectional);
  for (int i = 0; i < count; ++i) {
    Rng one(201, Stream::Test, static_cast<std::uint64_t>(i));
    Rng other(201, Stream::Test, static_cast<std::uint64_t>(i));
    visit(directions.sample(one), bidirectional.sample(other));
  }
}

// Law: f / q does not depend on the measure, so it is the same for one path in two charts; and so
// are its colour, its place on the film and its vertices. No path is lost, and those that are won
// end at an emitter that only a light side can begin at.
TEST(Bidirectional, WeightsAreThoseOfDirections) {
  int compared = 0;
  std::map<PathEnd, int> ends;
  for (const TestScene* test : scenes()) {
    const PathSampler directions = sampler_of(*test, PhaseSpace::Directions);
    const PathSampler bidirectional = sampler_of(*test, PhaseSpace::Bidirectional);
    int found = 0;
    int lost = 0;
    int won = 0;
    draw_both(*test, 110000, [&](const auto& a, const auto& b) {
      if (!a) {
        const bool is_new = b && std::isfinite(value_of(*test, *b).log_target);
        if (is_new && !(b->topology.has_light_side() && b->topology.ends_at_delta_emitter())) ++won;
        return;
      }
      const Contribution f = value_of(*test, *a);
      if (!std::isfinite(f.log_target)) return;
      ++found;
      if (!b) {
        ++lost;
        return;
      }
      if (!b->topology.has_light_side()) return;
      ++compared;
      ++ends[b->topology.end];
      const Contribution g = value_of(*test, *b);
      const double weight = f.log_target - directions.log_density(a->topology, a->coordinates);
      EXPECT_NEAR(weight, g.log_target - bidirectional.log_density(b->topology, b->coordinates),
                  1e-9 + 1e-10 * std::abs(weight))
          << test->name << ", " << path_class(test->scene, b->topology, b->coordinates);
      EXPECT_LT((f.color - g.color).abs().maxCoeff(), 1e-8);
      EXPECT_LT((f.film - g.film).norm(), 1e-8);
      EXPECT_LT(
          distance(vertices_of(*test, a->topology, a->coordinates),
                   vertices_of(*test, b->topology, b->coordinates), a->topology.scatter_count),
          1e-6);
    });
    // Rays that meet an edge may be rounded to either side.
    EXPECT_LE(lost, found / 1000) << test->name;
    EXPECT_LE(won, found / 1000) << test->name;
  }
  EXPECT_GT(compared, 5000);
  for (const PathEnd end :
       {PathEnd::AreaEmission, PathEnd::PointEmission, PathEnd::DirectionalEmission})
    EXPECT_GT(ends[end], 200);
}

/// E[f / q], in batches so that the tail of single weights does not spoil the test.
Moments mean_weight(const TestScene& test, PhaseSpace space, int count) {
  const PathSampler sampler = sampler_of(test, space);
  Moments batches;
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    Rng rng(204, Stream::Test, static_cast<std::uint64_t>(i));
    if (const auto path = sampler.sample(rng)) {
      const double weight = std::exp(value_of(test, *path).log_target -
                                     sampler.log_density(path->topology, path->coordinates));
      if (std::isfinite(weight)) sum += weight;
    }
    if ((i + 1) % 4000 != 0) continue;
    batches.add(sum / 4000);
    sum = 0;
  }
  return batches;
}

/// Mean luminance of images by bidirectional path tracing.
Moments traced_mean(const TestScene& test, int samples_per_pixel) {
  Moments traced;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    RenderOptions render;
    render.seed = seed;
    const Image image =
        render_bdpt(test.scene, {.max_depth = test.max_depth}, render, samples_per_pixel).image;
    double sum = 0;
    for (std::size_t i = 0; i < image.rgb.size(); ++i)
      sum += kLuminance[static_cast<Eigen::Index>(i % 3)] * static_cast<double>(image.rgb[i]);
    traced.add(3.0 * sum / static_cast<double>(image.rgb.size()));
  }
  return traced;
}

// Law: E[f / q] is the mean of the image also where light comes to a delta lobe straight from a
// point, a spot or from one direction, which the charts of Directions miss.
TEST(Bidirectional, MeanWeightIsTheMeanOfTheImage) {
  const TestScene& test = *scenes().front();
  const Moments traced = traced_mean(test, 16);
  const Moments both = mean_weight(test, PhaseSpace::Bidirectional, 2400000);
  EXPECT_GT(welch_p_value(both, traced), 0.01) << both.mean() << " +- " << both.error() << " and "
                                               << traced.mean() << " +- " << traced.error();
  EXPECT_LT(std::hypot(both.error(), traced.error()), 0.02 * traced.mean());
  const Moments directions = mean_weight(test, PhaseSpace::Directions, 2400000);
  EXPECT_LT(directions.mean(), 0.95 * traced.mean());
}

// ---- Derivatives ----

/// What the scenes must show on the light side between them.
const std::vector<std::string>& required_classes() {
  static const std::vector<std::string> classes{"diffuse by light",
                                                "conductor by light",
                                                "rough conductor ggx by light",
                                                "rough conductor beckmann by light",
                                                "phong glossy lobe by light",
                                                "dielectric transmission outside by light",
                                                "dielectric transmission inside by light",
                                                "dielectric reflection outside by light",
                                                "emission from planar mesh",
                                                "emission from sphere",
                                                "emission from point",
                                                "emission from spot",
                                                "emission from directional",
                                                "joined to the sensor",
                                                "joined between surfaces"};
  return classes;
}

// Law: jets, hand-derived rules, differences and nested jets agree, and so do gradients by jets in
// wide passes.
TEST(Bidirectional, DerivativesAgree) {
  std::map<std::string, int> seen;
  for (const TestScene* test : scenes()) {
    int checked = 0;
    over_light_sides(*test, 60000, [&](const Sample& path) {
      if (++checked > 400) return;
      const std::string name = path_class(test->scene, path.topology, path.coordinates);
      for (const auto& c : classes_of(test->scene, path.topology, path.coordinates)) ++seen[c];
      const PathCheck check = check_path(test->scene, path.topology, path.coordinates);
      for (const Quantity quantity : kQuantities)
        EXPECT_TRUE(check[quantity].passes(quantity))
            << test->name << ", " << driftlight::name(quantity) << ": " << name << ": "
            << check[quantity].error;
      PathDerivatives wide;
      differentiate(test->scene, path.topology, check.chart, {}, wide);
      const double scale = 1.0 + check.gradient_jets.norm();
      EXPECT_LT((wide.gradient - check.gradient_jets).norm(), 1e-9 * scale) << name;
    });
  }
  for (const std::string& name : required_classes()) EXPECT_GT(seen[name], 0) << name;
}

// Law: the factor of both sides is a root of the dense matrix: F^T F = Q, |det F|^2 = det Q, and
// its three members are F, F^-1 and F^-T.
TEST(Bidirectional, FactorIsARootOfTheConstraints) {
  int factors = 0;
  for (const TestScene* test : scenes()) {
    over_light_sides(*test, 25000, [&](const Sample& path) {
      const Chart chart(test->scene, path.topology, path.coordinates);
      const int d = chart.dimension();
      Linearization linear;
      linearize_by_hand(test->scene, path.topology, chart, {}, linear);
      if (factors % 2 == 1) linear.floor = 30.0 * kConstraintFloor;
      const TwoSidedFactor factor(linear);
      ASSERT_EQ(factor.status(), FactorStatus::Ok);
      ++factors;
      const Matrix q = constraint_matrix(linear);
      Matrix f(d, d);
      for (int j = 0; j < d; ++j) f.col(j) = factor.apply(Vector(Vector::Unit(d, j)));
      const Vector scale = q.diagonal().cwiseSqrt().cwiseInverse();
      const Matrix error = scale.asDiagonal() * (f.transpose() * f - q) * scale.asDiagonal();
      EXPECT_LT(error.norm(), 1e-10);
      const auto dense = CholeskyFactor::of(q);
      ASSERT_TRUE(dense);
      EXPECT_NEAR(factor.log_det(), dense->log_det(), 1e-6);
      Rng rng(205, Stream::Test, static_cast<std::uint64_t>(factors));
      Vector x(d);
      for (double& xi : x) xi = rng.normal();
      EXPECT_LT((factor.apply(factor.solve(x)) - x).norm(), 1e-7 * x.norm());
      EXPECT_LT((f.transpose() * factor.solve_transposed(x) - x).norm(), 1e-7 * x.norm());
    });
  }
  EXPECT_GT(factors, 1000);
}

// Law: derivatives that are not numbers have no factor.
TEST(Bidirectional, FactorSaysWhatFailed) {
  const TestScene& test = *scenes().front();
  bool tried = false;
  over_light_sides(test, 20000, [&](const Sample& path) {
    if (tried) return;
    tried = true;
    const Chart chart(test.scene, path.topology, path.coordinates);
    Linearization linear;
    linearize_by_hand(test.scene, path.topology, chart, {}, linear);
    linear.rows.row(linear.row_count() - 1).setConstant(std::nan(""));
    EXPECT_EQ(TwoSidedFactor(linear).status(), FactorStatus::NonFinite);
  });
  EXPECT_TRUE(tried);
}

/// The rules with one fault on the light side.
struct FaultyRules : HandRules {
  static inline std::function<void(LightFactor&, bool delta, bool interpolated)> change_factor;
  static inline double cosine_factor = 1;

  static LightFactor light_factor(const Vec3d& n_g, const Vec3d& n_s, const Vec3d& wi,
                                  const Vec3d& wo, bool interpolated, bool delta) {
    LightFactor f = HandRules::light_factor(n_g, n_s, wi, wo, interpolated, delta);
    if (change_factor) change_factor(f, delta, interpolated);
    return f;
  }
  static Vec3d log_cosine(const Vec3d& n, const Vec3d& v) {
    return cosine_factor * HandRules::log_cosine(n, v);
  }
};

/// True if hand and jets differ on some path; no other comparison may fail.
bool is_caught() {
  DerivativeFunctions functions;
  functions.by_hand = linearize_by_rules<FaultyRules>;
  bool caught = false;
  for (const TestScene* test : scenes()) {
    int checked = 0;
    over_light_sides(*test, 60000, [&](const Sample& path) {
      if (caught || ++checked > 400) return;
      const PathCheck check = check_path(test->scene, path.topology, path.coordinates,
                                         {.constraints = false, .divergence = false}, functions);
      caught = !check[Quantity::GradientHand].passes(Quantity::GradientHand);
    });
  }
  return caught;
}

// Law: every wrong sign and every wrong factor in the rules of the light side is caught.
TEST(Bidirectional, FaultyRulesAreCaught) {
  using LightFactor = HandRules::LightFactor;
  using Change = std::function<void(LightFactor&, bool delta, bool interpolated)>;
  const std::map<std::string, Change> changes{{"sign by w_o",
                                               [](auto& f, bool delta, bool) {
                                                 if (!delta) f.wo = Vec3d(-f.wo);
                                               }},
                                              {"sign by w_i",
                                               [](auto& f, bool delta, bool) {
                                                 if (!delta) f.wi = Vec3d(-f.wi);
                                               }},
                                              {"sign by n",
                                               [](auto& f, bool delta, bool bent) {
                                                 if (!delta && !bent) f.n = Vec3d(-f.n);
                                               }},
                                              {"n where it is constant",
                                               [](auto& f, bool delta, bool bent) {
                                                 if (!delta && bent) f.n = Vec3d(f.wo);
                                               }},
                                              {"delta, sign by w_o",
                                               [](auto& f, bool delta, bool) {
                                                 if (delta) f.wo = Vec3d(-f.wo);
                                               }},
                                              {"delta, factor by w_i",
                                               [](auto& f, bool delta, bool) {
                                                 if (delta) f.wi *= 1.01;
                                               }},
                                              {"delta, sign by n", [](auto& f, bool delta, bool) {
                                                 if (delta) f.n = Vec3d(-f.n);
                                               }}};
  for (const auto& [name, change] : changes) {
    FaultyRules::change_factor = change;
    EXPECT_TRUE(is_caught()) << name;
  }
  FaultyRules::change_factor = nullptr;
  FaultyRules::cosine_factor = -1;
  EXPECT_TRUE(is_caught()) << "emission, sign";
  FaultyRules::cosine_factor = 1;
  EXPECT_FALSE(is_caught());
}

}  // namespace
}  // namespace driftlight::test
