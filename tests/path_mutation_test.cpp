// SPDX-License-Identifier: Apache-2.0
/// Laws of mutations by vertices: values and densities are those of the path's coordinates, a
/// proposal has the density that it says, and each mutation is in detailed balance.
#include "path_mutation.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "driftlight/error.h"
#include "driftlight/render.h"
#include "driftlight/small_step.h"
#include "path_density.h"
#include "support/chi_square.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

/// log f below which products of densities underflow.
constexpr double kDark = -300;

constexpr MutationLimits kLimits{1, 6, 0.002, 0.3};

bool is_pinhole(const TestScene& test) {
  const Camera& camera = test.scene.camera();
  return !camera.is_orthographic() && !camera.has_lens();
}

/// Those of test_scenes() that VertexPath is for.
std::vector<std::reference_wrapper<const TestScene>> pinhole_scenes() {
  std::vector<std::reference_wrapper<const TestScene>> result;
  for (const TestScene& test : test_scenes())
    if (is_pinhole(test)) result.emplace_back(test);
  return result;
}

PathSampler both_ends(const TestScene& test) {
  return {test.scene, test.max_depth, LargeSteps::Bdpt, 1, PhaseSpace::Bidirectional};
}

/// log q_s of the path by its vertices, of all s = 0 .. n; the kept end is the sensor alone.
double log_strategy(const VertexPath& path, int s) {
  return PathMutation::log_way(path, {1, 0}, path.edges - s);
}

/// log of their sum.
double log_all_strategies(const VertexPath& path) {
  double sum = 0;
  for (int s = 0; s <= path.edges; ++s) sum += std::exp(log_strategy(path, s));
  return std::log(sum);
}

/// Lobes in order from the sensor, and the emitter.
std::string sequence(const VertexPath& path) {
  std::string name;
  for (int k = 1; k < path.edges; ++k) {
    const bool reflects = path(k).scattering == Scattering::Reflection;
    name += !path(k).delta ? 'D' : reflects ? 'R' : 'T';
  }
  return name + std::to_string(path.end.emitter);
}

// Law: of each path the ratios f / q_s, which have no measure, are those of its coordinates, for
// every strategy; and where one says that a strategy cannot make the path, so does the other.
TEST(VertexPath, ValueAndDensitiesAreThoseOfTheCoordinates) {
  int compared = 0;
  int impossible = 0;
  for (const TestScene& test : pinhole_scenes()) {
    const PathSampler sampler = both_ends(test);
    const EmissionGuide unguided(test.scene);
    for (std::uint64_t i = 0; i < 6000; ++i) {
      Rng rng(301, Stream::Test, i);
      const auto sample = sampler.sample(rng);
      if (!sample) continue;
      const Contribution value = contribution(test.scene, sample->topology, sample->coordinates);
      if (!(value.log_target > kDark)) continue;
      VertexPath path = vertex_path(test.scene, *sample);
      ASSERT_TRUE(path.evaluate(test.scene));
      EXPECT_LT((path.contribution().film - value.film).norm(), 1e-9);
      EXPECT_LT((path.contribution().color - value.color).abs().maxCoeff(), 1e-6);
      const auto q =
          strategy_densities(test.scene, unguided, sample->topology, sample->coordinates);
      for (int s = 0; s <= path.edges; ++s) {
        if (path.edges == 1 && s == 1) continue;  // no connection to the sensor
        const double there = std::log(q.by_light_vertices[static_cast<std::size_t>(s)]);
        const double here = log_strategy(path, s);
        if (!std::isfinite(there) || !std::isfinite(here)) {
          EXPECT_EQ(std::isfinite(there), std::isfinite(here)) << test.name << sequence(path) << s;
          ++impossible;
          continue;
        }
        ++compared;
        EXPECT_NEAR(path.contribution().log_target - here, value.log_target - there, 1e-5)
            << test.name << " " << sequence(path) << " s = " << s;
      }
    }
  }
  EXPECT_GT(compared, 10000);
  EXPECT_GT(impossible, 1000);
}

/// Compares what bidirectional path tracing finds with the same path by its vertices.
struct FoundSink {
  const Scene& scene;
  int compared = 0;

  void add(const Rgbd& value, const FoundPath& found) {
    if (!(luminance(value) > std::exp(kDark))) return;
    VertexPath path = vertex_path(found);
    ASSERT_TRUE(path.evaluate(scene)) << sequence(path);
    const double balanced = path.contribution().log_target - log_all_strategies(path);
    EXPECT_NEAR(std::log(luminance(value) / found.factor), balanced, 1e-5)
        << sequence(path) << " s = " << found.s;
    ++compared;
  }
  void splat(const Vec2d& film, const Rgbd& value, const FoundPath& found) {
    add(value, found);
    if (!(luminance(value) > std::exp(kDark))) return;
    VertexPath path = vertex_path(found);
    path.evaluate(scene);
    EXPECT_LT((path.contribution().film - film).norm(), 1e-9);
  }
};

TEST(VertexPath, RefusesOtherCameras) {
  for (const TestScene& test : test_scenes()) {
    if (is_pinhole(test)) continue;
    EXPECT_THROW(render_mlt(test.scene, {}, {}, 1), InputError);
    EXPECT_THROW(render_erpt(test.scene, {}, {}, 1), InputError);
  }
}

// Law: with the balance heuristic bidirectional path tracing values a path at f / sum_s q_s.
TEST(VertexPath, ValuesOfBidirectionalSamples) {
  for (const TestScene& test : pinhole_scenes()) {
    const EmissionGuide unguided(test.scene);
    BidirectionalTracer tracer(test.scene, unguided, MisHeuristic::Balance, test.max_depth);
    FoundSink sink{test.scene};
    for (std::uint64_t i = 0; i < 1500; ++i) {
      Rng rng(302, Stream::Test, i);
      const Vec2d film = rng.uniform2();
      tracer.sample(film, rng, sink);
    }
    EXPECT_GT(sink.compared, 500) << test.name;
  }
}

/// The first path of so many edges that the sampler draws.
VertexPath start_of(const TestScene& test, int edges, std::uint64_t seed) {
  const PathSampler sampler = both_ends(test);
  for (std::uint64_t i = 0;; ++i) {
    Rng rng(seed, Stream::Test, i);
    const auto sample = sampler.sample(rng);
    if (!sample || sample->topology.length() != edges) continue;
    VertexPath path = vertex_path(test.scene, *sample);
    if (path.evaluate(test.scene)) return path;
  }
}

// Law: in a closed diffuse sphere of albedo rho that emits L = 1, E[f / q] = rho^(n - 1) over paths
// of n edges that are regrown as a whole.
TEST(PathMutation, RegrowsTheClosedFurnace) {
  const double albedo = 0.6;
  const TestScene test{"furnace", furnace(albedo), 6};
  const PathMutation mutation(test.scene, kLimits);
  for (int n = 2; n <= 5; ++n) {
    const VertexPath x = start_of(test, n, 303);
    VertexPath y;
    Moments weight;
    for (std::uint64_t i = 0; i < 20000; ++i) {
      Rng rng(304, Stream::Test, i);
      const auto from_sensor = static_cast<int>(i % static_cast<std::uint64_t>(n + 1));
      const bool made =
          mutation.regrow(x, {1, 0}, from_sensor, n - from_sensor, y, rng) == TraceStatus::Ok &&
          y.evaluate(test.scene);
      weight.add(made ? (n + 1) * std::exp(y.contribution().log_target - log_all_strategies(y))
                      : 0.0);
    }
    const double expected = std::pow(albedo, n - 1);
    EXPECT_GT(student_p_value(weight, expected), sidak(0.01, 4)) << n << ": " << weight.mean();
    EXPECT_LT(weight.error(), 0.02 * expected);
  }
}

// Law: a way to regrow a part of a path has the density that log_way says. Drawn by all ways in
// turn and weighted with the density of one over their mean, each sequence of lobes comes as often
// as it does when it is drawn by that way alone. The weights are bounded, so the means are normal.
TEST(PathMutation, WaysHaveTheirDensities) {
  constexpr int kCount = 12000;
  std::vector<double> p_values;
  for (const TestScene& test : pinhole_scenes()) {
    const PathMutation mutation(test.scene, kLimits);
    const VertexPath x = start_of(test, 3, 305);
    for (const KeptEnds& kept : {KeptEnds{1, 0}, KeptEnds{2, 0}, KeptEnds{1, 1}, KeptEnds{2, 1},
                                 KeptEnds{1, 2}, KeptEnds{2, 2}}) {
      const int count = 2;
      VertexPath y;
      const auto draw = [&](int way, Rng& rng) {
        return mutation.regrow(x, kept, way, count - way, y, rng) == TraceStatus::Ok &&
               y.evaluate(test.scene);
      };
      std::array<std::map<std::string, Moments>, count + 1> weighted;
      std::array<std::map<std::string, double>, count + 1> plain;
      for (std::uint64_t i = 0; i < (count + 1) * kCount; ++i) {
        const auto way = static_cast<int>(i % (count + 1));
        Rng alone(306, Stream::Test, i);
        if (draw(way, alone)) plain[static_cast<std::size_t>(way)][sequence(y)] += 1.0;
        Rng together(311, Stream::Test, i);
        if (!draw(way, together)) continue;
        std::array<double, count + 1> q{};
        double sum = 0;
        for (int j = 0; j <= count; ++j)
          sum += q[static_cast<std::size_t>(j)] = std::exp(PathMutation::log_way(y, kept, j));
        for (std::size_t j = 0; j < q.size(); ++j) weighted[j][sequence(y)].add(q[j] / sum);
      }
      for (std::size_t j = 0; j < plain.size(); ++j)
        for (const auto& [name, hits] : plain[j]) {
          if (hits < 50) continue;
          const Moments& w = weighted[j][name];
          const auto draws = static_cast<double>(w.count());
          const double mean = draws * w.mean();
          const double variance = hits + draws * (w.variance() + w.mean() * w.mean());
          p_values.push_back(normal_p_value((hits - mean) / std::sqrt(variance)));
          EXPECT_GT(p_values.back(), 1e-5)
              << test.name << " " << name << " a = " << kept.sensor << " b = " << kept.light
              << " i = " << j << ": " << hits << " against " << mean;
        }
    }
  }
  EXPECT_GT(p_values.size(), 150U);
  const double significance = sidak(0.01, static_cast<int>(p_values.size()));
  for (const double p : p_values) EXPECT_GT(p, significance);
}

// Law: the probabilities of what is kept and of how many come instead add up to 1, and are those of
// the draws.
TEST(PathMutation, DeletionsAndCounts) {
  const TestScene& test = test_scenes().front();
  const PathMutation mutation(test.scene, {2, 5, 0.002, 0.3});
  std::vector<double> p_values;
  for (int edges = 2; edges <= 5; ++edges) {
    std::vector<KeptEnds> all;
    std::vector<double> expected;
    constexpr int kCount = 20000;
    for (int a = 1; a <= edges; ++a)
      for (int b = 0; a + b <= edges + 1; ++b) {
        all.push_back({a, b});
        expected.push_back(kCount * mutation.probability(all.back(), edges));
      }
    double sum = 0;
    for (const double e : expected) sum += e;
    EXPECT_NEAR(sum, kCount, 1e-6);
    std::vector<double> observed(all.size());
    Rng rng(307, Stream::Test, static_cast<std::uint64_t>(edges));
    for (int i = 0; i < kCount; ++i) {
      const KeptEnds kept = mutation.draw_kept(edges, rng);
      for (std::size_t j = 0; j < all.size(); ++j)
        if (all[j].sensor == kept.sensor && all[j].light == kept.light) observed[j] += 1.0;
    }
    p_values.push_back(chi_square(observed, expected).p_value);
    for (const KeptEnds& kept : all) {
      const int deleted = kept.deleted(edges);
      std::vector<double> counts(8);
      std::vector<double> likely(8);
      for (int k = 0; k < 8; ++k)
        likely[static_cast<std::size_t>(k)] = 2000 * mutation.probability(k, kept, deleted);
      for (int i = 0; i < 2000; ++i)
        counts[static_cast<std::size_t>(mutation.draw_count(kept, deleted, rng))] += 1.0;
      double total = 0;
      for (const double l : likely) total += l;
      EXPECT_NEAR(total, 2000, 1e-9);
      p_values.push_back(chi_square(counts, likely).p_value);
    }
  }
  const double significance = sidak(0.01, static_cast<int>(p_values.size()));
  for (const double p : p_values) EXPECT_GT(p, significance);
}

// Law: the film point moves by steps that are log-uniform in size, and as likely in any direction.
TEST(PathMutation, StepsOnTheFilm) {
  const TestScene test{"furnace", furnace(0.6), 6};
  const MutationLimits limits{1, 6, 0.001, 0.1};
  const PathMutation mutation(test.scene, limits);
  VertexPath x;
  for (std::uint64_t seed = 308; x.edges == 0; ++seed) {
    const VertexPath start = start_of(test, 3, seed);
    if ((start.contribution().film - Vec2d(0.5, 0.5)).norm() < 0.3) x = start;
  }
  VertexPath y;
  std::vector<double> sizes;
  std::vector<double> angles;
  MutationDensities densities;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    Rng rng(309, Stream::Test, i);
    ASSERT_EQ(mutation.from_sensor(x, y, densities, rng), TraceStatus::Ok);
    const Vec2d move = y.contribution().film - x.contribution().film;
    sizes.push_back(std::log(move.norm() / limits.step_min) /
                    std::log(limits.step_max / limits.step_min));
    angles.push_back(0.5 + std::atan2(move.y(), move.x()) * 0.5 * kInvPi);
  }
  EXPECT_GT(chi_square_uniform(sizes).p_value, 0.005);
  EXPECT_GT(chi_square_uniform(angles).p_value, 0.005);
}

// ---- Detailed balance -------------------------------------------------------------------------

using Propose = std::function<TraceStatus(const PathMutation&, const VertexPath&, VertexPath&,
                                          MutationDensities&, Rng&)>;

struct Kind {
  std::string name;
  Propose propose;
  bool keeps_lobes;
  int draws = 150000;
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> kKinds{
      {"bidirectional",
       [](const auto& by, const auto& x, auto& y, auto& t, auto& rng) {
         return by.bidirectional(x, y, t, rng);
       },
       false},
      {"from the sensor",
       [](const auto& by, const auto& x, auto& y, auto& t, auto& rng) {
         return by.from_sensor(x, y, t, rng);
       },
       true},
      {"caustic",
       [](const auto& by, const auto& x, auto& y, auto& t, auto& rng) {
         return PathMutation::has_caustic(x) ? by.caustic(x, y, t, rng) : TraceStatus::OtherLobe;
       },
       true},
      {"manifold",
       [](const auto& by, const auto& x, auto& y, auto& t, auto& rng) {
         return PathMutation::has_manifold(x) ? by.manifold(x, y, t, rng) : TraceStatus::OtherLobe;
       },
       true, 400000}};
  return kKinds;
}

/// Classes of paths that a mutation may leave: its length and its delta lobes, also in pairs; and
/// of perturbations, which keep these, the half of the film, the side of x_(n-1), and how far apart
/// and how inclined vertices are.
std::vector<std::string> classes_of(const Kind& kind, const VertexPath& path, const Scene& scene) {
  if (!kind.keeps_lobes) {
    int deltas = 0;
    for (int k = 1; k < path.edges; ++k) deltas += path(k).delta ? 1 : 0;
    const std::string edges = std::to_string(path.edges) + " edges";
    return {edges, std::to_string(deltas) + " delta",
            "emitter " + std::to_string(path.end.emitter) + " by " + edges, sequence(path)};
  }
  const Vec2d& film = path.contribution().film;
  const Vec3d last = path.edges > 1 ? path(path.edges - 1).surface.at.p : scene.center();
  const std::string lobes = sequence(path);
  const auto unit_of = [](double log) { return std::to_string(std::lround(2.0 * log)); };
  std::vector<std::string> classes{film.x() < 0.5 ? "left" : "right",
                                   film.y() < 0.5 ? "top" : "bottom",
                                   last.x() < scene.center().x() ? "low x" : "high x",
                                   last.z() < scene.center().z() ? "low z" : "high z",
                                   lobes + (film.x() < 0.5 ? " left" : " right"),
                                   lobes + (last.x() < scene.center().x() ? " low x" : " high x")};
  for (int k = 1; k < path.edges; ++k) {
    classes.push_back("arriving " + std::to_string(k) + " " + unit_of(path.log_arriving(k)));
    classes.push_back("leaving " + std::to_string(k) + " " + unit_of(path.log_leaving(k)));
  }
  return classes;
}

/// Draws paths of all lengths by all ways in turn, and their weights w = f / q.
class WeightedPaths {
 public:
  explicit WeightedPaths(const TestScene& test)
      : test_(test),
        mutation_(test.scene, {1, test.max_depth, 0.002, 0.3}),
        any_(start_of(test, 2, 312)) {}

  const PathMutation& mutation() const { return mutation_; }
  double weight(const VertexPath& path) const {
    return test_.max_depth * (path.edges + 1) *
           std::exp(path.contribution().log_target - log_all_strategies(path));
  }
  bool draw(std::uint64_t i, VertexPath& path, Rng& rng) const {
    const int n = 1 + static_cast<int>(i % static_cast<std::uint64_t>(test_.max_depth));
    const int way = std::min(static_cast<int>((n + 1) * rng.uniform()), n);
    return mutation_.regrow(any_, {1, 0}, way, n - way, path, rng) == TraceStatus::Ok &&
           path.evaluate(test_.scene) && path.contribution().log_target > kDark;
  }
  /// Of w over the draws.
  double mean_weight() const {
    double sum = 0;
    VertexPath path;
    constexpr int kCount = 20000;
    for (std::uint64_t i = 0; i < kCount; ++i) {
      Rng rng(313, Stream::Test, i);
      if (draw(i, path, rng)) sum += weight(path);
    }
    return sum / kCount;
  }

 private:
  const TestScene& test_;
  PathMutation mutation_;
  VertexPath any_;
};

/// Smallest p-value over pairs of classes, Sidak-corrected, that the flows of a mutation between
/// them are equal,
///   E[w(x) a(x, y) 1_A(x) 1_B(y)] = E[w(x) a(x, y) 1_B(x) 1_A(y)],
/// x drawn with density q and w = f / q. Where balance is detailed that holds among the paths whose
/// weight has a bound too, which makes sums normal. Pairs that rest on few samples are left out. If
/// `exchanged`, the two densities are taken for each other.
double balance_p_value(const TestScene& test, const Kind& kind, bool exchanged, int* pairs) {
  struct Flow {
    double there = 0, back = 0, squares = 0, largest = 0;
  };
  std::map<std::pair<std::string, std::string>, Flow> flows;
  const WeightedPaths paths(test);
  const double bound = 20.0 * paths.mean_weight();
  VertexPath x;
  VertexPath y;
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(kind.draws); ++i) {
    Rng rng(310, Stream::Test, i);
    if (!paths.draw(i, x, rng)) continue;
    const double w = paths.weight(x);
    MutationDensities t;
    if (!(w < bound) || kind.propose(paths.mutation(), x, y, t, rng) != TraceStatus::Ok) continue;
    if (!(y.contribution().log_target > kDark) || !(paths.weight(y) < bound)) continue;
    if (exchanged) std::swap(t.forward, t.reverse);
    const double a = std::exp(log_acceptance(x.contribution().log_target,
                                             y.contribution().log_target, t.forward, t.reverse));
    const auto from = classes_of(kind, x, test.scene);
    const auto to = classes_of(kind, y, test.scene);
    for (std::size_t j = 0; j < from.size(); ++j) {
      if (from[j] == to[j]) continue;
      Flow& flow = flows[std::minmax(from[j], to[j])];
      (from[j] < to[j] ? flow.there : flow.back) += w * a;
      flow.squares += w * w * a * a;
      flow.largest = std::max(flow.largest, w * w * a * a);
    }
  }
  double smallest = 1;
  int count = 0;
  for (const auto& [classes, flow] : flows) {
    if (!(flow.largest > 0.0) || flow.squares < 12 * flow.largest) continue;
    ++count;
    smallest =
        std::min(smallest, normal_p_value((flow.there - flow.back) / std::sqrt(flow.squares)));
  }
  *pairs += count;
  return count == 0 ? 1.0 : 1.0 - std::pow(1.0 - smallest, count);
}

// Law: each mutation is in detailed balance with f, whatever the lobes, the emitters and the ends.
TEST(PathMutation, IsInDetailedBalance) {
  const int tests = static_cast<int>(kinds().size() * pinhole_scenes().size());
  for (const Kind& kind : kinds()) {
    int pairs = 0;
    for (const TestScene& test : pinhole_scenes())
      EXPECT_GT(balance_p_value(test, kind, false, &pairs), sidak(0.01, tests))
          << kind.name << " in " << test.name;
    EXPECT_GT(pairs, 15) << kind.name;
  }
}

// Law: that test has teeth. With the densities exchanged each mutation fails it.
TEST(PathMutation, WithExchangedDensitiesItIsNot) {
  for (const Kind& kind : kinds()) {
    double smallest = 1;
    int pairs = 0;
    for (const TestScene& test : pinhole_scenes())
      smallest = std::min(smallest, balance_p_value(test, kind, true, &pairs));
    EXPECT_LT(smallest, 1e-3) << kind.name;
  }
}

}  // namespace
}  // namespace driftlight::test
