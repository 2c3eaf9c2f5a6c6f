// SPDX-License-Identifier: Apache-2.0
/// Laws of energy redistribution. That its images are right is for the slow tests.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "brightness_map.h"
#include "chain_schedule.h"
#include "driftlight/error.h"
#include "driftlight/render.h"
#include "found_path.h"
#include "light_rate.h"
#include "lobe_sequence.h"
#include "remainder.h"
#include "support/learned_guide.h"
#include "support/test_scenes.h"
#include "support/tiles.h"

namespace driftlight::test {
namespace {

/// The value of each path that bidirectional path tracing finds, against f / q of the same path
/// with coordinates and by its vertices: but for the path's factor they are one.
struct ComparingSink {
  const Scene& scene;
  const Remainder& remainder;
  Vec2d film;
  int charted = 0;
  int uncharted = 0;
  int strategies = 0;  ///< bit s of those with a chart
  int different = 0;
  int by_vertices = 0;
  int different_by_vertices = 0;
  int other_state = 0;  ///< of those by vertices

  void add(const Rgbd& value, const FoundPath& path) { splat(film, value, path); }
  void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
    const double y = luminance(value) / path.factor;
    if (!(y > 1e-200)) return;
    if (is_pinhole(scene.camera())) compare_by_vertices(at, y, path);
    const auto sample = state_of(scene, path);
    if (!sample) {
      ++uncharted;
      return;
    }
    ++charted;
    strategies |= 1 << std::min(path.s, 3);
    const Share share = remainder.share(sample->topology, sample->coordinates,
                                        contribution(scene, sample->topology, sample->coordinates));
    EXPECT_NEAR((share.film - at).norm(), 0.0, 1e-6);
    if (std::abs(share.w * share.brightness / y - 1.0) > 1e-5) ++different;
  }

  void compare_by_vertices(const Vec2d& at, double y, const FoundPath& path) {
    VertexPath vertices = vertex_path(path);
    if (!vertices.evaluate(scene)) return;
    ++by_vertices;
    const Share share = remainder.share(vertices);
    EXPECT_NEAR((share.film - at).norm(), 0.0, 1e-6);
    if (std::abs(share.w * share.brightness / y - 1.0) > 1e-5) ++different_by_vertices;
    for (const PhaseSpace space : {PhaseSpace::Directions, PhaseSpace::Bidirectional})
      if (!are_alike(state_of(scene, path, space), state_of(scene, vertices, space))) ++other_state;
  }

  /// Whether both exist, with the same lobes and coordinates.
  bool are_alike(const std::optional<PathSampler::Sample>& a,
                 const std::optional<PathSampler::Sample>& b) const {
    if (!a || !b) return a.has_value() == b.has_value();
    if (a->topology.end != b->topology.end || a->topology.block_count != b->topology.block_count ||
        !(LobeSequence(a->topology) == LobeSequence(b->topology)))
      return false;
    for (int i = 0; i < a->topology.block_count; ++i)
      if ((a->coordinates(i) - b->coordinates(i)).norm() > 1e-6 * scene.radius()) return false;
    return true;
  }
};

TEST(FoundPath, ItsValueIsContributionOverDensity) {
  const BrightnessMap flat({}, 1.0);
  for (const TestScene& test : test_scenes()) {
    SCOPED_TRACE(test.name);
    // Guided and at a low rate, so that no density is as it was.
    const EmissionGuide guide = learned_guide(test).at_rate(0.5);
    const Remainder remainder(test.scene, guide, flat, 1.0);
    BidirectionalTracer by_balance(test.scene, guide, MisHeuristic::Balance, test.max_depth);
    BidirectionalTracer by_power(test.scene, guide, MisHeuristic::Power, test.max_depth);
    ComparingSink sink{test.scene, remainder, {}};
    for (std::uint64_t i = 0; i < 4000; ++i) {
      Rng rng(1, Stream::Test, i);
      sink.film = rng.uniform2();
      (i % 2 == 0 ? by_balance : by_power).sample(sink.film, rng, sink);
    }
    EXPECT_GT(sink.charted, 1000);
    const bool hits = test.name != "stage";  // its emitters cannot be hit
    EXPECT_EQ(sink.strategies, hits ? 15 : 14);
    // A ray that only just passes an edge, or many round mirrors, may be traced anew otherwise.
    EXPECT_LT(sink.different, 1e-3 * sink.charted);
    EXPECT_LT(sink.uncharted, 0.3 * sink.charted);
    EXPECT_LE(sink.different_by_vertices, 1e-3 * sink.by_vertices);
    EXPECT_LE(sink.other_state, 2e-3 * sink.by_vertices);
    if (is_pinhole(test.scene.camera())) {
      EXPECT_GT(sink.by_vertices, 0.999 * (sink.charted + sink.uncharted));
    }
  }
}

/// All light is deposited in the mean, and no start has longer chains than another.
TEST(ChainSchedule, IsOfTheSameLengthWhateverTheLight) {
  for (const double light : {0.3, 70.0, 2e3, 5e4, 1e7}) {
    SCOPED_TRACE(light);
    double sum = 0;
    constexpr int kDraws = 20000;
    for (int i = 0; i < kDraws; ++i) {
      Rng rng(3, Stream::Test, i);
      const ChainSchedule chains = schedule_chains(light, 0.2, 100, rng);
      EXPECT_EQ(chains.mutations, 100.0);
      EXPECT_GE(chains.deposit, 0.2);
      EXPECT_LE(chains.chains, 256.0);
      sum += chains.chains * chains.mutations * chains.deposit;
    }
    EXPECT_NEAR(sum / kDraws, light, 4.0 * std::sqrt(light * 20.0 / kDraws));
  }
}

TEST(BrightnessMap, GivesTheMeanOfAnEvenFilm) {
  std::vector<FilmValue> found;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) found.push_back({{(x + 0.5) / 64, (y + 0.5) / 64}, 3.0});
  const BrightnessMap map(found, 64 * 64);
  EXPECT_NEAR(map({0.3, 0.8}), 3.0, 1e-12);
  EXPECT_NEAR(map({0.0, 1.0}), 3.0, 1e-12);
  EXPECT_NEAR(map.film_unit(), 64.0 * 3.0, 1e-9);
}

/// A tenth of the mean is left where nothing was found, and one firefly does not show.
TEST(BrightnessMap, IsPositiveAndCutsFireflies) {
  std::vector<FilmValue> found;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 32; ++x) found.push_back({{(x + 0.5) / 64, (y + 0.5) / 64}, 1.0});
  const BrightnessMap without(found, 64 * 64);
  EXPECT_NEAR(without({0.95, 0.5}), 0.05, 1e-12);
  EXPECT_NEAR(without({0.05, 0.5}), 0.95, 1e-12);
  found.push_back({{0.9, 0.5}, 1e7});
  EXPECT_LT(BrightnessMap(found, 64 * 64)({0.9, 0.5}), 0.5);
}

TEST(BrightnessMap, IsOneWithoutLight) {
  const BrightnessMap map({}, 100);
  EXPECT_EQ(map({0.5, 0.5}), 1.0);
}

/// Even light on one half; then with a point in each cell that is sixteen times as bright.
TEST(BrightnessMap, AddsLightWithoutItsBrightestPoints) {
  std::vector<FilmValue> found;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 32; ++x) found.push_back({{(x + 0.5) / 64, (y + 0.5) / 64}, 1.0});
  BrightnessMap alone({}, 100);
  alone.add({}, 100);
  EXPECT_EQ(alone({0.5, 0.5}), 1.0);
  alone.add(found, 64 * 64);
  const double even = 0.1 * 0.5 + 0.9;
  EXPECT_NEAR(alone({0.05, 0.5}), even, 1e-12);
  EXPECT_NEAR(alone({0.95, 0.5}), 0.05, 1e-12);

  BrightnessMap both(found, 64 * 64);
  both.add(found, 64 * 64);
  EXPECT_NEAR(both({0.05, 0.5}), 2.0 * even, 1e-12);

  const std::size_t count = found.size();
  for (std::size_t i = 0; i < count; ++i)
    if (i % 4 == 0 && i / 32 % 4 == 0) found.push_back({found[i].film, 15.0});
  BrightnessMap bright({}, 100);
  bright.add(found, 64 * 64);
  // The mean is 0.5 (1 + 15 / 16); of the sixteen parts of a cell one has 16, the others 1.
  const double floor = 0.1 * 0.5 * 31.0 / 16.0;
  const double dim = floor + 0.9;
  const double lit = floor + 0.9 * 16.0;
  EXPECT_NEAR(bright({0.05, 0.5}), std::sqrt((15 * dim + lit) / (15 / dim + 1 / lit)), 1e-12);
}

LangevinResult render_small(const Scene& scene, int threads, std::optional<double> threshold,
                            std::optional<double> perturbations = 0.0, double scale = 0.32,
                            int pilot = 65536) {
  LangevinOptions options;
  options.kernel.scale = scale;
  options.redistribution.pilot = pilot;
  options.redistribution.perturbations = perturbations;
  options.mode = Mode::Redistribution;
  options.max_depth = 6;
  options.redistribution.threshold = threshold;
  RenderOptions render;
  render.threads = threads;
  render.seed = 5;
  return render_langevin(scene, options, render, 2);
}

TEST(Redistribution, DoesNotDependOnThreads) {
  const Scene& scene = test_scenes().front().scene;
  const auto with = [&](int threads) { return render_small(scene, threads, 0.1, 0.5, 0.32, 8192); };
  const LangevinResult one = with(1);
  EXPECT_GT(one.statistics.mutations, 500U);
  for (const int threads : {2, 4}) {
    const LangevinResult other = with(threads);
    EXPECT_EQ(one.image.rgb, other.image.rgb);
    EXPECT_EQ(one.statistics.mutations, other.statistics.mutations);
    EXPECT_EQ(one.statistics.small_step.accepted, other.statistics.small_step.accepted);
  }
}

TEST(Redistribution, PlanDoesNotDependOnThreads) {
  const Scene& scene = test_scenes().front().scene;
  const auto with = [&](int threads) {
    return render_small(scene, threads, std::nullopt, std::nullopt, 0.32, 16384);
  };
  const LangevinResult one = with(1);
  const LangevinResult two = with(2);
  EXPECT_EQ(one.statistics.threshold, two.statistics.threshold);
  EXPECT_EQ(one.statistics.perturbations, two.statistics.perturbations);
  EXPECT_EQ(one.statistics.mutations_per_sample, two.statistics.mutations_per_sample);
  EXPECT_EQ(one.statistics.light_subpaths, two.statistics.light_subpaths);
  EXPECT_EQ(one.image.rgb, two.image.rgb);
}

/// The noise of samples that draw whether they have a light subpath.
class DrawnNoise {
 public:
  void add(const Rgbd& value, const FoundPath&) { own_ += luminance(value); }
  void splat(const Vec2d&, const Rgbd& value, const FoundPath&) {
    splats2_ += sqr(luminance(value));
  }

  /// Of two samples at one film point.
  template <class Draw>
  double of_pair(const Draw& draw) {
    own_ = splats2_ = 0;
    draw(*this);
    const double first = std::exchange(own_, 0.0);
    draw(*this);
    return 0.5 * (sqr(first - own_) + splats2_);
  }

 private:
  double own_ = 0;
  double splats2_ = 0;
};

/// What samples that all have a light subpath tell of lower rates, against samples at these rates.
TEST(LightRate, NoiseIsThatOfSamplesAtTheRate) {
  const Scene scene = limelight();
  LangevinOptions options;
  options.max_depth = 5;
  options.redistribution.pilot = 1 << 20;
  const Pilot pilot{BrightnessMap({}, 1.0), EmissionGuide(scene)};
  for (const LightRate& at : judge_light_rates(scene, options, 3, pilot)) {
    const EmissionGuide guide = pilot.guide.at_rate(at.rate);
    BidirectionalTracer tracer(scene, guide, MisHeuristic::Power, options.max_depth);
    DrawnNoise noise;
    RunningMean mean;
    for (std::uint64_t i = 0; i < 65536; ++i) {
      Rng rng(7, Stream::Test, i);
      const Vec2d film = rng.uniform2();
      mean.add(noise.of_pair([&](DrawnNoise& sink) { tracer.sample(film, rng, sink); }));
    }
    EXPECT_NEAR(at.noise / mean.mean(), 1.0, 0.05) << at.rate << " " << mean.error() / mean.mean();
  }
}

/// Under an even sky light subpaths find nothing that the sensor's do not find as well. With light
/// that only they find, each sample is to have one.
TEST(Redistribution, ChoosesHowManyLightSubpathsPay) {
  SceneBuilder builder;
  const auto white =
      builder.add_material({builder.add_bsdf(Diffuse{Texture(Rgbd{0.7, 0.6, 0.5})}), std::nullopt});
  builder.add_shape(quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}), white);
  builder.add_shape(round_mesh({0, 0.5, 0}, 0.5, 8), white);
  builder.set_environment(
      EnvironmentMap(sun_bitmap(32, 16, 1.0F), Eigen::Matrix3d::Identity(), 1.0));
  Camera camera = look_at({0.3, 1.6, 3.0}, {0, 0.4, 0}, 0.5);
  camera.half_height = 0.375;
  camera.film_width = 32;
  camera.film_height = 24;
  builder.set_camera(camera);
  const double under_sky = render_small(builder.build(), 2, 1.0).statistics.light_subpaths;
  EXPECT_LT(under_sky, 1.0);
  EXPECT_EQ(render_small(load_small("point_caustic").scene, 2, 1.0).statistics.light_subpaths, 1.0);
}

// Law: where chains do not move there is nothing to gain by them.
TEST(Redistribution, ChoosesAHighThresholdForChainsThatStay) {
  const LoadedScene loaded = load_small("small_hole");
  const LangevinResult moving = render_small(loaded.scene, 2, std::nullopt);
  const LangevinResult stuck = render_small(loaded.scene, 2, std::nullopt, 0.0, 1e6);
  EXPECT_GE(stuck.statistics.threshold, 8.0);
  EXPECT_LT(moving.statistics.threshold, stuck.statistics.threshold);
}

/// Where all light comes through an opening samples are noisy though few are bright, and
/// perturbations keep to it; they have to spread over many pixels to be worth it.
TEST(Redistribution, PerturbsChainsThroughAnOpening) {
  const LoadedScene loaded = load_small("small_hole", {{"width", "128"}, {"height", "96"}});
  const LangevinStatistics chosen =
      render_small(loaded.scene, 2, std::nullopt, std::nullopt).statistics;
  EXPECT_EQ(chosen.perturbations, 1.0);
  EXPECT_LT(chosen.threshold, 1.0);
  EXPECT_GT(chosen.mutations_per_sample, 4.0);
}

TEST(Redistribution, PerturbationsNeedAPinhole) {
  EXPECT_THROW(render_small(lens(false), 2, 1.0, 0.5), InputError);
  EXPECT_EQ(render_small(lens(false), 2, std::nullopt, std::nullopt).statistics.perturbations, 0.0);
}

// Law: without levels, chains and what a pilot learns about light it is bidirectional path tracing,
// bit for bit.
TEST(Redistribution, AloneIsBidirectionalPathTracing) {
  const LoadedScene loaded = load_small("cornell_glossy");
  LangevinOptions options;
  options.mode = Mode::Splitting;
  options.max_depth = 5;
  options.splitting.levels = 0;
  options.redistribution = {.threshold = 1e9,
                            .mutations_per_sample = 1,
                            .perturbations = 0,
                            .guide = false,
                            .pilot = 1024,
                            .light_subpaths = 1};
  RenderOptions render;
  render.seed = 5;
  EXPECT_EQ(render_langevin(loaded.scene, options, render, 4).image.rgb,
            render_bdpt(loaded.scene, BdptOptions{.max_depth = 5}, render, 4).image.rgb);
}

/// What no sample exceeds is carried by the samples alone.
TEST(Redistribution, LeavesNothingAboveAHighThreshold) {
  const LangevinResult result = render_small(test_scenes().front().scene, 2, 1e8);
  EXPECT_EQ(result.statistics.mutations, 0U);
  EXPECT_EQ(result.statistics.remainder, 0.0);
  EXPECT_GT(result.statistics.b, 0.0);
}

/// An emitter as bright as what is around it has w = 1; where it is seen, tau is 16 at least.
TEST(Redistribution, LeavesWhatIsSeenDirectlyToSamples) {
  EXPECT_EQ(render_small(furnace(0.0), 2, 0.001).statistics.mutations, 0U);
  EXPECT_EQ(Remainder::tau_seen(0.5), 16.0);
  EXPECT_EQ(Remainder::tau_seen(2.0), 32.0);
}

}  // namespace
}  // namespace driftlight::test
