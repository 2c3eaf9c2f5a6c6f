// SPDX-License-Identifier: Apache-2.0
/// Laws of path sampling: the density that log_density says is the one that sample draws from.
#include "driftlight/path_sampler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "driftlight/contribution.h"
#include "driftlight/render.h"
#include "driftlight/running_mean.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

/// Length and end of a path in words.
std::string kind(const PathTopology& topology) {
  static const std::array<std::string, 5> ends{"hit", "environment", "area connection",
                                               "point connection", "directional connection"};
  const auto end = topology.vertices.begin() + topology.scatter_count;
  const bool delta =
      std::any_of(topology.vertices.begin(), end, [](const auto& v) { return v.delta; });
  return std::to_string(topology.length()) + " edges" + (delta ? " by a delta lobe, " : ", ") +
         ends[static_cast<std::size_t>(topology.end)] + " of emitter " +
         std::to_string(topology.emitter);
}

enum class Favourite { Hit, Connect };

/// A sampler whose table prefers one strategy nine times out of ten.
PathSampler biased_sampler(const TestScene& test, Favourite favourite) {
  PathSampler sampler(test.scene, test.max_depth);
  std::vector<RunningMean> weights(static_cast<std::size_t>(sampler.entry_count()));
  weights[0].add(1.0);
  // Entries: length 1 by hit only, then (2, hit), (2, connect), (3, hit), ..
  for (std::size_t i = 1; i < weights.size(); ++i)
    if ((i % 2 == 0) == (favourite == Favourite::Connect)) weights[i].add(1.0);
  sampler.learn(weights);
  return sampler;
}

/// Probability of entry i of that table: the favourites share nine tenths, all share the last one.
double table_probability(const PathSampler& sampler, int entry, Favourite favourite) {
  const int count = sampler.entry_count();
  const bool connects = entry > 0 && entry % 2 == 0;
  const bool favoured = entry == 0 || connects == (favourite == Favourite::Connect);
  const int favourites = 1 + (count - 1) / 2;
  return (favoured ? 0.9 / favourites : 0.0) + 0.1 / count;
}

/// Calls visit(sample) or visit(nothing) for `count` attempts.
template <class Visit>
void draw(const PathSampler& sampler, std::uint64_t seed, int count, const Visit& visit) {
  for (int i = 0; i < count; ++i) {
    Rng rng(seed, Stream::Test, static_cast<std::uint64_t>(i));
    visit(sampler.sample(rng));
  }
}

double log_target(const TestScene& test, const PathSampler::Sample& path) {
  return contribution(test.scene, path.topology, path.coordinates).log_target;
}

// Law: in a closed diffuse sphere of albedo rho that emits L = 1, E[f / q] = sum rho^k over the
// allowed lengths, and each length n has its own rho^(n - 1).
void check_furnace(LargeSteps large_steps) {
  const double albedo = 0.6;
  const Scene scene = furnace(albedo);
  const int max_depth = 6;
  const PathSampler sampler(scene, max_depth, large_steps);
  Moments total;
  std::array<Moments, 7> by_length;
  draw(sampler, 101, 30000, [&](const std::optional<PathSampler::Sample>& path) {
    double weight = 0;
    int length = 0;
    if (path) {
      length = path->topology.length();
      weight = std::exp(contribution(scene, path->topology, path->coordinates).log_target -
                        sampler.log_density(path->topology, path->coordinates));
    }
    total.add(weight);
    for (int n = 1; n <= max_depth; ++n)
      by_length[static_cast<std::size_t>(n)].add(n == length ? weight : 0.0);
  });
  const double significance = sidak(0.01, max_depth + 1);
  const double expected = (1.0 - std::pow(albedo, max_depth)) / (1.0 - albedo);
  EXPECT_GT(student_p_value(total, expected), significance) << total.mean() << " " << expected;
  EXPECT_LT(total.error(), 0.02 * expected);
  for (int n = 1; n <= max_depth; ++n)
    EXPECT_GT(student_p_value(by_length[static_cast<std::size_t>(n)], std::pow(albedo, n - 1)),
              significance)
        << n;
}

TEST(PathSampler, ClosedFurnace) { check_furnace(LargeSteps::Path); }
TEST(PathSampler, ClosedFurnaceFromBothEnds) { check_furnace(LargeSteps::Bdpt); }

// Law: q is a density. Drawn with one table and weighted with q' / q, each kind of path comes as
// often as it does when it is drawn with the other table: for every length, end and emitter,
// whether a strategy hits or connects. The weights are bounded by 20, so the means of enough paths
// are normal.
TEST(PathSampler, DensitiesOfDifferentTablesAgree) {
  const int count = 240000;
  constexpr double kEnough = 200;
  int kinds = 0;
  std::vector<double> p_values;
  for (const TestScene& test : test_scenes()) {
    const PathSampler hitting = biased_sampler(test, Favourite::Hit);
    const PathSampler connecting = biased_sampler(test, Favourite::Connect);
    // Frequencies under `hitting`, found with both samplers.
    std::map<std::string, double> plain;
    std::map<std::string, std::array<double, 2>> weighted;
    draw(hitting, 102, count, [&](const std::optional<PathSampler::Sample>& path) {
      if (path && std::isfinite(log_target(test, *path))) plain[kind(path->topology)] += 1.0;
    });
    draw(connecting, 103, count, [&](const std::optional<PathSampler::Sample>& path) {
      if (!path || !std::isfinite(log_target(test, *path))) return;
      const double ratio = std::exp(hitting.log_density(path->topology, path->coordinates) -
                                    connecting.log_density(path->topology, path->coordinates));
      EXPECT_LT(ratio, 20.0);
      auto& sums = weighted[kind(path->topology)];
      sums[0] += ratio;
      sums[1] += ratio * ratio;
    });
    for (const auto& [name, sums] : weighted) {
      const double hits = plain[name];
      if (hits < kEnough) continue;
      ++kinds;
      const double variance = hits + sums[1];
      const double p = normal_p_value((hits - sums[0]) / std::sqrt(variance));
      p_values.push_back(p);
      EXPECT_GT(p, 1e-5) << test.name << ": " << name << ": " << hits << " against " << sums[0]
                         << " +- " << std::sqrt(variance);
    }
    for (const auto& [name, hits] : plain)
      EXPECT_TRUE(hits < kEnough || weighted.contains(name)) << test.name << ": " << name;
  }
  EXPECT_GT(kinds, 50);
  const double significance = sidak(0.01, kinds);
  for (const double p : p_values) EXPECT_GT(p, significance);
}

/// A sampler from both ends that prefers s = `light_vertices`, eight to one. The others stay likely
/// enough for weights between its density and the uniform one to be small.
PathSampler sampler_of(const TestScene& test, int light_vertices) {
  PathSampler sampler(test.scene, test.max_depth, LargeSteps::Bdpt);
  std::vector<RunningMean> weights(static_cast<std::size_t>(sampler.entry_count()));
  for (int i = 0; i < sampler.entry_count(); ++i)
    weights[static_cast<std::size_t>(i)].add(
        sampler.strategy(i).light_vertices == light_vertices ? 8.0 : 1.0);
  sampler.learn(weights);
  return sampler;
}

/// Adds a p-value for each kind of path of a scene and each s: whether paths drawn with a
/// preference for s come as often, weighted, as with the uniform table.
void compare_strategies(const TestScene& test, int count, std::vector<double>& p_values) {
  const PathSampler uniform(test.scene, test.max_depth, LargeSteps::Bdpt);
  std::map<std::string, double> plain;
  draw(uniform, 120, count, [&](const std::optional<PathSampler::Sample>& path) {
    if (path && std::isfinite(log_target(test, *path))) plain[kind(path->topology)] += 1.0;
  });
  for (int s = 0; s <= test.max_depth; ++s) {
    const PathSampler favouring = sampler_of(test, s);
    std::map<std::string, std::array<double, 2>> weighted;
    draw(favouring, 121, count, [&](const std::optional<PathSampler::Sample>& path) {
      if (!path || !std::isfinite(log_target(test, *path))) return;
      const double ratio = std::exp(uniform.log_density(path->topology, path->coordinates) -
                                    favouring.log_density(path->topology, path->coordinates));
      EXPECT_LT(ratio, 8.0);
      auto& sums = weighted[kind(path->topology)];
      sums[0] += ratio;
      sums[1] += ratio * ratio;
    });
    for (const auto& [name, hits] : plain) {
      if (hits < 100) continue;
      const auto& sums = weighted[name];
      const double deviation = std::sqrt(hits + sums[1]);
      p_values.push_back(normal_p_value((hits - sums[0]) / deviation));
      EXPECT_GT(p_values.back(), 1e-6) << test.name << ", s = " << s << ": " << name << ": " << hits
                                       << " against " << sums[0] << " +- " << deviation;
    }
  }
}

/// A mirror whose shading normals lean far from its plane, between a floor and a lamp.
TestScene bent_mirror() {
  SceneBuilder builder;
  const auto white = builder.add_material({builder.add_bsdf(Diffuse{}), std::nullopt});
  const auto mirror = builder.add_material({builder.add_bsdf(Conductor{}), std::nullopt});
  builder.add_shape(quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}), white);
  builder.add_shape(quad({-1.5, 0, -1}, {3, 0, 0}, {0, 2, 0}, false, 0.8), mirror);
  builder.add_shape(quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}), white, Rgbd::Ones());
  builder.set_camera(look_at({0, 1.5, 3}, {0, 0.4, 0}, 0.6));
  return {"bent mirror", builder.build(), 5};
}

// Law: the same for paths from both ends, whatever the number s of vertices on the light's side. A
// path with s = 0, 1, 2, .. light vertices is as dense as the paths that come with another s; also
// through a delta lobe whose shading normal is another than the geometric one.
TEST(PathSampler, DensitiesOfAllStrategiesAgree) {
  std::vector<double> p_values;
  for (const TestScene& test : test_scenes()) compare_strategies(test, 60000, p_values);
  compare_strategies(bent_mirror(), 400000, p_values);
  const auto kinds = static_cast<int>(p_values.size());
  EXPECT_GT(kinds, 200);
  const double significance = sidak(0.01, kinds);
  for (const double p : p_values) EXPECT_GT(p, significance);
}

/// The chance that a path drawn from the uniform table came by a connection, from densities alone:
/// with q = c (h + k), h by hitting and k by connecting, and q' = c_h h + c_k k of another table,
/// k / (h + k) = (q' / q - c_h / c) / (c_k / c - c_h / c).
double connection_share(const PathSampler& uniform, const PathSampler& other, Favourite favourite,
                        const PathSampler::Sample& path) {
  const int length = path.topology.length();
  const double c = 1.0 / uniform.entry_count();
  const double hit = table_probability(other, 2 * length - 3, favourite) / c;
  const double connect = table_probability(other, 2 * length - 2, favourite) / c;
  const double ratio = std::exp(other.log_density(path.topology, path.coordinates) -
                                uniform.log_density(path.topology, path.coordinates));
  return (ratio - hit) / (connect - hit);
}

/// End of a path, and for a hit the kind of shape.
std::string end_kind(const Scene& scene, const PathTopology& topology) {
  if (topology.end == PathEnd::PointConnection) return "point";
  if (topology.end == PathEnd::DirectionalConnection) return "directional";
  if (topology.end == PathEnd::Environment)
    return scene.emitters()[topology.emitter].index() == 2 ? "constant sky" : "map";
  const auto& light = std::get<AreaEmitter>(scene.emitters()[topology.emitter]);
  const Shape& shape = scene.shapes()[light.shape];
  return (topology.end == PathEnd::Hit ? "hit of " : "connection to ") +
         std::string(shape.extent.planar ? "plane" : "solid");
}

/// A rough floor close under large lamps, which both strategies find equally well.
TestScene lamps() {
  SceneBuilder builder;
  const auto metal = builder.add_bsdf(RoughConductor{{Distribution::Ggx, 0.6}});
  const auto material = builder.add_material({metal, std::nullopt});
  builder.add_shape(quad({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}), material);
  builder.add_shape(quad({-1.5, 1, -2}, {1.2, 0, 0}, {0, 0, 3}), material, Rgbd::Ones());
  builder.add_shape(round_mesh({1, 0.8, -0.5}, 0.7, 4), material, Rgbd::Ones());
  builder.set_camera(look_at({0, 0.8, 3.5}, {0, 0.2, 0}, 0.5));
  return {"lamps", builder.build(), 2};
}

// Law: the density splits rightly between the strategies: each way to end comes from a connection
// as often as the densities say, and with certainty where only one strategy can find it.
TEST(PathSampler, StrategiesComeByTheirShare) {
  struct Tally {
    double drawn = 0;
    double expected = 0;
    double variance = 0;
  };
  std::map<std::string, Tally> tallies;
  const auto count_paths = [&](const TestScene& test, int count) {
    const PathSampler uniform(test.scene, test.max_depth);
    const PathSampler other = biased_sampler(test, Favourite::Connect);
    draw(uniform, 108, count, [&](const std::optional<PathSampler::Sample>& path) {
      if (!path || path->topology.length() == 1) return;
      if (!std::isfinite(log_target(test, *path))) return;
      const double share = connection_share(uniform, other, Favourite::Connect, *path);
      EXPECT_GT(share, -1e-9);
      EXPECT_LT(share, 1.0 + 1e-9);
      Tally& tally = tallies[end_kind(test.scene, path->topology)];
      tally.drawn += path->entry % 2 == 0 ? 1.0 : 0.0;
      tally.expected += share;
      tally.variance += std::max(0.0, share * (1.0 - share));
    });
  };
  for (const TestScene& test : test_scenes()) count_paths(test, 80000);
  count_paths(lamps(), 400000);
  EXPECT_EQ(tallies.size(), 8U);
  const double significance = sidak(0.01, static_cast<int>(tallies.size()));
  for (const auto& [name, tally] : tallies) {
    if (name == "point" || name == "directional") {
      EXPECT_NEAR(tally.drawn, tally.expected, 1e-6 * tally.drawn);
      continue;
    }
    EXPECT_GT(tally.variance, name.starts_with("hit") ? 1500.0 : 150.0) << name;
    const double z = (tally.drawn - tally.expected) / std::sqrt(tally.variance);
    EXPECT_GT(normal_p_value(z), significance)
        << name << ": " << tally.drawn << " against " << tally.expected << " +- "
        << std::sqrt(tally.variance);
  }
}

/// E[f / q], in batches so that the tail of single weights does not spoil the test.
Moments mean_weight(const TestScene& test, const PathSampler& sampler, std::uint64_t seed,
                    int count) {
  Moments batches;
  double sum = 0;
  int in_batch = 0;
  draw(sampler, seed, count, [&](const std::optional<PathSampler::Sample>& path) {
    if (path) {
      const double weight = std::exp(log_target(test, *path) -
                                     sampler.log_density(path->topology, path->coordinates));
      if (std::isfinite(weight)) sum += weight;
    }
    if (++in_batch < 1000) return;
    batches.add(sum / in_batch);
    sum = 0;
    in_batch = 0;
  });
  return batches;
}

// Law: E[f / q] is the mean luminance of the image, whatever the table: two tables agree with each
// other and with the path tracer, which knows neither f nor q.
TEST(PathSampler, MeanWeightIsTheMeanOfTheImage) {
  const int tests = 2 * static_cast<int>(test_scenes().size());
  const double significance = sidak(0.01, tests);
  for (const TestScene& test : test_scenes()) {
    const Moments hitting = mean_weight(test, biased_sampler(test, Favourite::Hit), 104, 100000);
    const Moments connecting =
        mean_weight(test, biased_sampler(test, Favourite::Connect), 105, 100000);
    EXPECT_GT(welch_p_value(hitting, connecting), significance)
        << test.name << ": " << hitting.mean() << " +- " << hitting.error() << " and "
        << connecting.mean() << " +- " << connecting.error();
    Moments traced;
    for (std::uint64_t seed = 0; seed < 24; ++seed) {
      RenderOptions render;
      render.threads = 1;
      render.seed = seed;
      const PathResult result = render_path(test.scene, {.max_depth = test.max_depth}, render, 16);
      EXPECT_EQ(result.non_finite, 0U);
      double sum = 0;
      for (std::size_t i = 0; i < result.image.rgb.size(); i += 3)
        for (std::size_t c = 0; c < 3; ++c)
          sum += kLuminance[static_cast<Eigen::Index>(c)] *
                 static_cast<double>(result.image.rgb[i + c]);
      traced.add(3.0 * sum / static_cast<double>(result.image.rgb.size()));
    }
    const Moments& better = hitting.error() < connecting.error() ? hitting : connecting;
    EXPECT_GT(welch_p_value(better, traced), significance)
        << test.name << ": " << better.mean() << " +- " << better.error() << " and "
        << traced.mean() << " +- " << traced.error();
  }
}

// Law: so it is for paths from both ends.
TEST(PathSampler, MeanWeightFromBothEnds) {
  const double significance = sidak(0.01, 2 * static_cast<int>(test_scenes().size()));
  for (const TestScene& test : test_scenes()) {
    const Moments hitting = mean_weight(test, biased_sampler(test, Favourite::Hit), 109, 200000);
    for (const int s : {2, 3}) {
      const Moments both = mean_weight(test, sampler_of(test, s), 110, 200000);
      EXPECT_GT(welch_p_value(hitting, both), significance)
          << test.name << ", s = " << s << ": " << hitting.mean() << " +- " << hitting.error()
          << " and " << both.mean() << " +- " << both.error();
    }
  }
}

// Law: a path longer than max_depth cannot be sampled.
TEST(PathSampler, NothingBeyondMaxDepth) {
  const TestScene& test = test_scenes().front();
  const PathSampler shallow(test.scene, 3);
  for (const PathSampler::Sample& path : light_paths(test, 500, 106)) {
    const double log_q = shallow.log_density(path.topology, path.coordinates);
    EXPECT_EQ(std::isfinite(log_q), path.topology.length() <= 3);
  }
}

// Law: the same stream draws the same path, bit for bit.
TEST(PathSampler, Reproducible) {
  for (const TestScene& test : test_scenes()) {
    const auto once = light_paths(test, 100, 107);
    const auto again = light_paths(test, 100, 107);
    for (std::size_t i = 0; i < once.size(); ++i) {
      EXPECT_EQ(once[i].topology.block_count, again[i].topology.block_count);
      for (int k = 0; k < once[i].topology.block_count; ++k)
        EXPECT_EQ(once[i].coordinates(k), again[i].coordinates(k));
    }
  }
}

}  // namespace
}  // namespace driftlight::test
