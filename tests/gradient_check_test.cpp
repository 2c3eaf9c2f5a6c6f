// SPDX-License-Identifier: Apache-2.0
/// Laws of the gradient checker: right code passes in every class, kinks are told from errors, and
/// nothing depends on the number of threads. That wrong code fails is in hand_faults_test.cpp.
#include "driftlight/gradient_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "derivative_judge.h"
#include "driftlight/contribution.h"
#include "driftlight/gradient_probe.h"
#include "driftlight/path_class.h"
#include "driftlight/scene_check.h"
#include "support/path_classes.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

constexpr double kTolerance = 1e-6;

DerivativeCheck judge(const std::function<double(double)>& f, double derivative) {
  const auto functions = [&](double x) { return Values(Values::Constant(1, f(x))); };
  return DerivativeJudge(functions, Values::Constant(1, derivative), 1.0, 0.01, kTolerance)
      .run()
      .front();
}

// Law: a smooth function's derivative agrees, and one that is off by more than the tolerance is
// wrong.
TEST(DerivativeJudge, TellsRightFromWrong) {
  const auto f = [](double x) { return std::exp(std::sin(3.0 * x + 0.4)); };
  const double slope = 3.0 * std::cos(0.4) * std::exp(std::sin(0.4));
  EXPECT_EQ(judge(f, slope).verdict, Verdict::Agrees);
  for (const double factor : {-1.0, 0.0, 2.0, 1.0 + 3e-6, 1.0 - 3e-6}) {
    const DerivativeCheck check = judge(f, factor * slope);
    EXPECT_EQ(check.verdict, Verdict::Wrong) << factor;
    EXPECT_NEAR(check.error, std::abs(factor - 1.0) / std::max(1.0, std::abs(factor)), 1e-7);
  }
  EXPECT_EQ(judge(f, std::numeric_limits<double>::quiet_NaN()).verdict, Verdict::Wrong);
}

// Law: at a kink the slope of either side is no error, and any other is.
TEST(DerivativeJudge, TellsKinksFromErrors) {
  for (const double at : {0.0, 1e-9, -3e-8}) {
    const auto f = [at](double x) { return x < at ? 2.0 * x : 2.0 * at - 5.0 * (x - at); };
    // Away from the kink the base point lies on one side, whose slope the differences see too.
    const double slope = at > 0.0 ? 2.0 : -5.0;
    const Verdict verdict = judge(f, slope).verdict;
    EXPECT_TRUE(verdict == Verdict::Kink || (at != 0.0 && verdict == Verdict::Agrees)) << at;
    EXPECT_EQ(judge(f, 0.7).verdict == Verdict::Kink, false) << at;
  }
  const auto kink = [](double x) { return std::abs(x); };
  EXPECT_EQ(judge(kink, 1.0).verdict, Verdict::Kink);
  EXPECT_EQ(judge(kink, -1.0).verdict, Verdict::Kink);
  EXPECT_EQ(judge(kink, 0.7).verdict, Verdict::Wrong);
}

// Law: where the function ends next to the point, its slope from within is no error.
TEST(DerivativeJudge, TellsEdgesFromErrors) {
  const double infinity = std::numeric_limits<double>::infinity();
  const auto f = [&](double x) { return x <= 0.0 ? 2.0 * x + x * x : infinity; };
  EXPECT_EQ(judge(f, 2.0).verdict, Verdict::Kink);
  EXPECT_NE(judge(f, 3.0).verdict, Verdict::Kink);
  EXPECT_NE(judge(f, 3.0).verdict, Verdict::Agrees);
}

// Law: where the rounding of the function hides its slope, there is no verdict.
TEST(DerivativeJudge, DoesNotDecideWhatRoundingHides) {
  const auto f = [](double x) { return x + 1e-6 * std::sin(1e13 * x); };
  EXPECT_EQ(judge(f, 1.0 + 1e-5).verdict, Verdict::Undecided);
}

// Law: right code passes on every path of every class, almost nothing is set aside, and every class
// is seen.
TEST(GradientCheck, RightCodePassesInEveryClass) {
  ClassCounter classes;
  for (const TestScene& test : test_scenes()) {
    SceneCheckOptions options;
    options.paths = 1500;
    options.max_depth = test.max_depth;
    const SceneCheck check = check_scene(test.scene, options);
    for (const GradientFailure& failure : check.table.failures())
      ADD_FAILURE() << test.name << " " << name(failure.quantity) << " " << failure.path_class
                    << " " << failure.value << " path " << failure.index;
    EXPECT_GE(check.table.all().paths(), 1500U);
    // The yards have a wall that shows its black back.
    const std::vector<std::string> hidden{"bsdf 1 (diffuse)"};
    const bool yard = test.name == "sun" || test.name == "overcast";
    EXPECT_EQ(check.not_reached, yard ? hidden : std::vector<std::string>{}) << test.name;
    for (const Quantity quantity : kQuantities) {
      const QuantitySummary all = check.table.all().summary(quantity);
      EXPECT_LT(all.set_aside(), 0.02) << test.name << " " << name(quantity);
      EXPECT_LT(all.median, 1e-2 * tolerance(quantity)) << test.name << " " << name(quantity);
      EXPECT_LE(all.median, all.maximum);
    }
    for (const auto& [feature, record] : check.table.features())
      for (std::uint64_t i = 0; i < record.paths(); ++i) classes.add({feature});
  }
  for (const std::string& missing : classes.missing(3)) ADD_FAILURE() << missing;
}

bool same(const ClassRecord& a, const ClassRecord& b) {
  if (a.paths() != b.paths() || a.worst() != b.worst()) return false;
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary x = a.summary(quantity);
    const QuantitySummary y = b.summary(quantity);
    if (x.paths != y.paths || x.compared != y.compared || x.kinks != y.kinks ||
        x.undecided != y.undecided || x.median != y.median || x.maximum != y.maximum ||
        x.worst != y.worst)
      return false;
  }
  return true;
}

// Law: the table does not depend on the number of threads, but on the seed; and the worst path can
// be drawn again by its index alone, with the same error.
TEST(GradientCheck, DependsOnTheSeedAlone) {
  const TestScene& test = test_scenes().front();
  SceneCheckOptions options;
  options.paths = 600;
  options.max_depth = test.max_depth;
  options.seed = 7;
  options.threads = 1;
  const SceneCheck one = check_scene(test.scene, options);
  options.threads = 2;
  const SceneCheck two = check_scene(test.scene, options);
  options.seed = 8;
  const SceneCheck other = check_scene(test.scene, options);
  EXPECT_TRUE(same(one.table.all(), two.table.all()));
  EXPECT_FALSE(same(one.table.all(), other.table.all()));
  ASSERT_EQ(one.table.classes().size(), two.table.classes().size());
  for (const auto& [name, record] : one.table.classes())
    EXPECT_TRUE(same(record, two.table.classes().at(name))) << name;
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary all = one.table.all().summary(quantity);
    const auto path = draw_light_path(test.scene, test.max_depth, 7, all.worst);
    ASSERT_TRUE(path);
    const PathCheck check = check_path(test.scene, path->topology, path->coordinates);
    EXPECT_EQ(check[quantity].error, all.maximum) << name(quantity);
    const std::string whole = path_class(test.scene, path->topology, path->coordinates);
    EXPECT_EQ(one.table.classes().count(whole), 1U) << whole;
  }
}

/// A wall with a bitmap of 4 x 4 texels, lit by a point.
Scene textured_wall() {
  SceneBuilder builder;
  Texture texture;
  texture.bitmap = pattern_bitmap(4, 4, 0.2, 0.9);
  const auto wall = builder.add_material({builder.add_bsdf(Diffuse{texture}), std::nullopt});
  builder.add_shape(quad({-1, -1, -2}, {2, 0, 0}, {0, 2, 0}, true), wall);
  builder.add_emitter(PointEmitter{{0.3, 0.4, 0.5}, {1, 2, 3}});
  builder.set_camera(look_at({0, 0, 0}, {0, 0, -1}, 0.8));
  return builder.build();
}

/// The path by way of texture coordinates (u, v) of the wall.
PathSampler::Sample path_through(const Scene& scene, double u, double v) {
  PathSampler::Sample path;
  for (std::uint64_t i = 0;; ++i) {
    const auto drawn = draw_light_path(scene, 2, 0, i);
    if (drawn && drawn->topology.scatter_count == 1) {
      path = *drawn;
      break;
    }
  }
  const PathTopology pattern = path.topology;
  path.coordinates(0) = Vec3d(2.0 * u - 1.0, 2.0 * v - 1.0, -2.0).normalized();
  EXPECT_EQ(trace(scene, pattern, path.coordinates, path.topology), TraceStatus::Ok);
  return path;
}

// Law: between texels, where the slope of the texture jumps, the coordinates that cross the edge
// are kinks and no error; off the edge all are compared.
TEST(GradientCheck, ReportsTexelEdgesAsKinks) {
  const Scene scene = textured_wall();
  const auto compare = [&](double u, double v) {
    const PathSampler::Sample path = path_through(scene, u, v);
    return check_path(scene, path.topology, path.coordinates)[Quantity::GradientRidders];
  };
  // Centres of texels lie at (i + 1/2) / 4.
  const Comparison edge = compare(0.375, 0.43);
  EXPECT_GE(edge.kinks, 1);
  EXPECT_LE(edge.error, tolerance(Quantity::GradientRidders));
  const Comparison inside = compare(0.41, 0.43);
  EXPECT_EQ(inside.kinks + inside.undecided, 0);
  EXPECT_EQ(inside.compared, 2);
  EXPECT_LE(inside.error, tolerance(Quantity::GradientRidders));
}

// Law: a wrong gradient at a kink is no kink.
TEST(GradientCheck, WrongGradientAtAKinkIsAnError) {
  const Scene scene = textured_wall();
  const PathSampler::Sample path = path_through(scene, 0.375, 0.43);
  DerivativeFunctions functions;
  functions.by_jets = [](const Scene& s, const PathTopology& t, const Chart& c,
                         const DerivativeRequest& request, Linearization& result) {
    linearize_by_jets(s, t, c, request, result);
    result.gradient *= -1.0;
  };
  const PathCheck check = check_path(scene, path.topology, path.coordinates, {}, functions);
  EXPECT_EQ(check[Quantity::GradientRidders].kinks, 0);
  EXPECT_FALSE(check[Quantity::GradientRidders].passes(Quantity::GradientRidders));
}

// Law: what is not asked for is not compared.
TEST(GradientCheck, ComparesWhatIsSelected) {
  const TestScene& test = test_scenes().front();
  const auto path = light_paths(test, 1, 61).front();
  const auto compared = [&](const CheckSelection& selection) {
    const PathCheck check = check_path(test.scene, path.topology, path.coordinates, selection);
    std::vector<bool> result;
    result.reserve(kQuantityCount);
    for (const Quantity quantity : kQuantities) result.push_back(check[quantity].compared > 0);
    return result;
  };
  using Flags = std::vector<bool>;
  EXPECT_EQ(compared({}), (Flags{true, true, true, true, true}));
  EXPECT_EQ(compared({.constraints = false, .divergence = false}),
            (Flags{true, true, false, false, false}));
  EXPECT_EQ(compared({.gradient = false, .divergence = false}),
            (Flags{false, false, true, true, false}));
  EXPECT_EQ(compared({.divergence = false, .hand = false}),
            (Flags{false, true, false, true, false}));
  EXPECT_EQ(compared({.gradient = false, .constraints = false}),
            (Flags{false, false, false, false, true}));
}

// Law: a probe checks the first state and then few, what the kernel uses of them, and the same ones
// each time.
TEST(GradientProbe, SamplesWhatTheKernelUses) {
  const TestScene& test = test_scenes().front();
  const auto paths = light_paths(test, 200, 62);
  const auto probe_all = [&](const KernelOptions& options, std::uint64_t chain) {
    GradientProbe probe(test.scene, options, 3, chain);
    for (int round = 0; round < 25; ++round)
      for (const auto& path : paths) probe.visit(path.topology, path.coordinates);
    return probe.paths();
  };
  KernelOptions options;
  options.derivatives = DerivativeMethod::Jet;
  const auto checked = probe_all(options, 2);
  ASSERT_GE(checked.size(), 1U);
  EXPECT_LT(checked.size(), 20U);
  EXPECT_EQ(checked.front().path_class,
            path_class(test.scene, paths.front().topology, paths.front().coordinates));
  const auto again = probe_all(options, 2);
  ASSERT_EQ(again.size(), checked.size());
  for (std::size_t i = 0; i < checked.size(); ++i) {
    EXPECT_EQ(again[i].path_class, checked[i].path_class);
    EXPECT_EQ(checked[i].index, 64U + i);
    EXPECT_EQ(checked[i].results[0].compared, 0);  // by hand
    EXPECT_GT(checked[i].results[1].compared, 0);
    EXPECT_EQ(checked[i].results[4].compared, 0);  // the divergence, without Drift::Full
  }
}

// ---- The table ----

CheckedPath checked(std::uint64_t index, const std::string& name, double error, int compared,
                    int kinks) {
  CheckedPath path;
  path.index = index;
  path.path_class = name;
  path.classes = {name};
  path.results[1] = {error, compared, kinks, 0};
  return path;
}

// Law: median, maximum and worst are those of the paths on which something was compared.
TEST(GradientTable, SummarisesPaths) {
  GradientTable table;
  table.add(checked(3, "a", 1e-9, 4, 0));
  table.add(checked(5, "a", 3e-8, 4, 0));
  table.add(checked(8, "b", 2e-9, 3, 1));
  table.add(checked(9, "b", 0.0, 0, 4));
  const QuantitySummary all = table.all().summary(Quantity::GradientRidders);
  EXPECT_EQ(all.paths, 3U);
  EXPECT_EQ(all.compared, 11U);
  EXPECT_EQ(all.kinks, 5U);
  EXPECT_EQ(all.median, 2e-9);
  EXPECT_EQ(all.maximum, 3e-8);
  EXPECT_EQ(all.worst, 5U);
  EXPECT_DOUBLE_EQ(all.set_aside(), 5.0 / 16.0);
  EXPECT_EQ(table.features().at("b").paths(), 2U);
  EXPECT_EQ(table.all().worst(), 5U);
  EXPECT_TRUE(table.failures().empty());
}

// Law: each way to fail is found and named.
TEST(GradientTable, NamesFailures) {
  using Kind = GradientFailure::Kind;
  GradientTable wrong;
  wrong.add(checked(1, "good", 1e-9, 4, 0));
  wrong.add(checked(2, "bad", 1e-3, 4, 0));
  ASSERT_EQ(wrong.failures().size(), 1U);
  EXPECT_EQ(wrong.failures()[0].kind, Kind::Error);
  EXPECT_EQ(wrong.failures()[0].quantity, Quantity::GradientRidders);
  EXPECT_EQ(wrong.failures()[0].path_class, "bad");
  EXPECT_EQ(wrong.failures()[0].value, 1e-3);
  EXPECT_EQ(wrong.failures()[0].index, 2U);

  GradientTable hidden;
  hidden.add(checked(0, "seen", 1e-9, 4, 0));
  for (std::uint64_t i = 1; i <= 4; ++i) hidden.add(checked(i, "unseen", 0.0, 0, 4));
  EXPECT_TRUE(hidden.failures().empty());
  hidden.add(checked(5, "unseen", 0.0, 0, 4));
  ASSERT_EQ(hidden.failures().size(), 1U);
  EXPECT_EQ(hidden.failures()[0].kind, Kind::NotCompared);
  EXPECT_EQ(hidden.failures()[0].path_class, "unseen");

  GradientTable aside;
  aside.add(checked(1, "a", 1e-9, 980, 19));
  EXPECT_TRUE(aside.failures().empty());
  aside.add(checked(2, "a", 1e-9, 0, 2));
  ASSERT_EQ(aside.failures().size(), 1U);
  EXPECT_EQ(aside.failures()[0].kind, Kind::SetAside);
}

// Law: names are sorted as people do, numbers by value.
TEST(GradientTable, SortsNumbersByValue) {
  const ByNameAndNumber less;
  EXPECT_TRUE(less("length 2", "length 10"));
  EXPECT_FALSE(less("length 10", "length 2"));
  EXPECT_TRUE(less("length 10: a", "length 10: b"));
  EXPECT_TRUE(less("length 1", "length 1: a"));
  EXPECT_TRUE(less("diffuse x2 > b", "diffuse x12 > a"));
  EXPECT_TRUE(less("diffuse", "hit"));
  EXPECT_FALSE(less("same", "same"));
}

// Law: f down to 1e-300 counts as light.
TEST(GradientCheck, CarriesLight) {
  EXPECT_TRUE(carries_light(0.0));
  EXPECT_TRUE(carries_light(std::log(1e-299)));
  EXPECT_FALSE(carries_light(std::log(1e-301)));
  EXPECT_FALSE(carries_light(-std::numeric_limits<double>::infinity()));
  EXPECT_FALSE(carries_light(std::numeric_limits<double>::quiet_NaN()));
}

}  // namespace
}  // namespace driftlight::test
