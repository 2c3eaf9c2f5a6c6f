// SPDX-License-Identifier: Apache-2.0
/// Whole images: the Langevin sampler against path tracing, both against closed forms and against
/// an independent renderer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "driftlight/image.h"
#include "driftlight/render.h"
#include "driftlight/scene_file.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight {
namespace {

constexpr int kRuns = 20;
constexpr int kTile = 8;

LoadedScene load_small(const std::string& name,
                       const std::map<std::string, std::string>& defines = {}) {
  LoadOptions options;
  options.defines = {{"width", "32"}, {"height", "24"}};
  options.defines.insert(defines.begin(), defines.end());
  return load_scene(std::filesystem::path(DRIFTLIGHT_SCENE_DIR) / (name + ".xml"), options);
}

/// Mean luminance of each tile of kTile x kTile pixels.
std::vector<double> tile_means(const Image& image) {
  std::vector<double> means;
  for (int top = 0; top + kTile <= image.height; top += kTile)
    for (int left = 0; left + kTile <= image.width; left += kTile) {
      double sum = 0;
      for (int y = top; y < top + kTile; ++y)
        for (int x = left; x < left + kTile; ++x) {
          const float* p = image.pixel(x, y);
          sum += luminance(Rgbd(static_cast<double>(p[0]), static_cast<double>(p[1]),
                                static_cast<double>(p[2])));
        }
      means.push_back(sum / (kTile * kTile));
    }
  return means;
}

/// Tile means over independent runs; render(seed) is one run.
template <class Render>
std::vector<test::Moments> tiles_over_runs(const Render& render) {
  std::vector<test::Moments> tiles;
  for (int run = 0; run < kRuns; ++run) {
    const std::vector<double> means = tile_means(render(static_cast<std::uint64_t>(run)));
    tiles.resize(means.size());
    for (std::size_t i = 0; i < means.size(); ++i) tiles[i].add(means[i]);
  }
  return tiles;
}

double median(const std::vector<double>& sorted) { return sorted[sorted.size() / 2]; }

/// How much to render of a scene, and how well its tiles are then known.
struct Work {
  const char* scene;
  int samples_per_pixel;
  double mutations_per_pixel;
  int bootstrap;
  /// Bound on the median over tiles of the standard error of langevin - path, relative: a test that
  /// cannot see a bias of three times this much would prove nothing.
  double resolution;
  double large_step_probability = 0.2;
  /// An island of light that one strategy alone finds, and hardly ever: the brightness that chains
  /// give it is right on average, but so skewed that a t-test over 20 runs does not see it.
  bool rare_direct_island = false;
};

void PrintTo(const Work& work, std::ostream* out) { *out << work.scene; }

struct Configuration {
  const char* name;
  Drift drift;
  LargeSteps large_steps = LargeSteps::Bdpt;
  DirectLight direct = DirectLight::Apart;
  PhaseSpace phase_space = PhaseSpace::Directions;
};

/// Rough metal and white balls under a spot and parallel light.
Scene limelight() {
  SceneBuilder builder;
  const auto material = [&](Bsdf bsdf) {
    return builder.add_material({builder.add_bsdf(std::move(bsdf)), std::nullopt});
  };
  const auto white = material(Diffuse{Texture(Rgbd{0.7, 0.6, 0.5})});
  builder.add_shape(test::quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}), white);
  builder.add_shape(test::quad({-2, 0, -1.5}, {4, 0, 0}, {0, 3, 0}), white);
  const Microfacets rough{Distribution::Ggx, 0.4};
  builder.add_shape(
      test::round_mesh({-0.5, 0.6, 0.2}, 0.5, 8),
      material(RoughConductor{rough, {0.2, 0.9, 1.1}, {3.9, 2.4, 2.2}, Texture(Rgbd{1, 1, 1})}));
  builder.add_shape(test::round_mesh({0.6, 0.5, 0.0}, 0.45, 5), white);
  builder.add_emitter(SpotEmitter({1.5, 2.5, 1.0}, {-1.6, -2.1, -0.9}, {20, 18, 15}, 0.6, 0.1));
  builder.add_emitter(DirectionalEmitter{Vec3d(0.6, -1.0, -0.7).normalized(), {0.5, 0.8, 1.0}});
  PerspectiveCamera camera = test::look_at({0.2, 1.6, 3.0}, {0, 0.6, 0}, 0.5);
  camera.half_height = 0.375;
  camera.film_width = 32;
  camera.film_height = 24;
  builder.set_camera(camera);
  return builder.build();
}

/// The ring is made so rough that path tracing hits the light's reflection often: else its rare
/// hits would make means that are not normal.
LoadedScene load_scene_of(const Work& work) {
  const std::string name = work.scene;
  if (name == "limelight") return {limelight(), 5, {}};
  if (name == "ring_caustic") return load_small(name, {{"alpha", "0.2"}});
  return load_small(name);
}

/// Path-traced tiles of a scene, rendered once for all configurations.
const std::vector<test::Moments>& traced_tiles(const Work& work) {
  static std::map<std::string, std::vector<test::Moments>> known;
  auto& tiles = known[work.scene];
  if (tiles.empty()) {
    const LoadedScene loaded = load_scene_of(work);
    tiles = tiles_over_runs([&](std::uint64_t seed) {
      RenderOptions render;
      render.seed = 1000 + seed;
      return render_path(loaded.scene, PathOptions{loaded.max_depth.value()}, render,
                         work.samples_per_pixel)
          .image;
    });
  }
  return tiles;
}

class LangevinEqualsPath : public testing::TestWithParam<Work> {};

/// The means of independent images agree tile by tile: Welch's test, Sidak-corrected at 1 %, for
/// steps without drift, with the gradient, and with the divergence, large steps from the sensor and
/// from both ends, direct light apart or by the chains, coordinates from one end or both. All use
/// the constraint matrix.
TEST_P(LangevinEqualsPath, TileMeans) {
  const Work& work = GetParam();
  const LoadedScene loaded = load_scene_of(work);
  const std::vector<test::Moments>& traced = traced_tiles(work);
  for (const Configuration& configuration :
       {Configuration{"brownian", Drift::None}, Configuration{"gradient", Drift::Gradient},
        Configuration{"divergence", Drift::Full},
        Configuration{"from the sensor", Drift::Gradient, LargeSteps::Path, DirectLight::Chain},
        Configuration{"chains alone", Drift::None, LargeSteps::Bdpt, DirectLight::Chain},
        Configuration{"both ends", Drift::Gradient, LargeSteps::Bdpt, DirectLight::Apart,
                      PhaseSpace::Bidirectional}}) {
    if (work.rare_direct_island && configuration.direct == DirectLight::Chain) continue;
    LangevinOptions options;
    options.mode = Mode::Chain;
    options.large_step_probability = work.large_step_probability;
    options.large_steps = configuration.large_steps;
    options.direct = configuration.direct;
    options.max_depth = loaded.max_depth.value();
    options.kernel.drift = configuration.drift;
    options.phase_space = configuration.phase_space;
    options.bootstrap = work.bootstrap;
    const auto sampled = tiles_over_runs([&](std::uint64_t seed) {
      RenderOptions render;
      render.seed = seed;
      return render_langevin(loaded.scene, options, render, work.mutations_per_pixel).image;
    });
    const double level = test::sidak(0.01, static_cast<int>(sampled.size()));
    std::vector<double> errors;
    for (std::size_t i = 0; i < sampled.size(); ++i) {
      errors.push_back(std::hypot(sampled[i].error(), traced[i].error()) / traced[i].mean());
      EXPECT_GT(test::welch_p_value(sampled[i], traced[i]), level)
          << configuration.name << ", tile " << i << ": langevin " << sampled[i].mean() << " +- "
          << sampled[i].error() << ", path " << traced[i].mean() << " +- " << traced[i].error();
    }
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(median(errors), work.resolution) << configuration.name;
    RecordProperty(std::string("error_") + configuration.name, std::to_string(median(errors)));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, LangevinEqualsPath,
    testing::Values(Work{"furnace_sphere", 64, 200, 50000, 0.01},
                    Work{"cornell_glossy", 300, 300, 100000, 0.04},
                    // The lamp's reflection in the glass is the rare island. Large steps are
                    // frequent, as small ones hardly leave the ball's silhouette.
                    Work{"glass_caustic", 1200, 400, 1000000, 0.05, 0.5, true},
                    Work{"small_hole", 400, 400, 200000, 0.08},
                    Work{"glossy_chain", 600, 300, 400000, 0.12},
                    Work{"door_ajar", 200, 150, 200000, 0.12},
                    Work{"ring_caustic", 300, 200, 200000, 0.04},
                    Work{"limelight", 256, 200, 100000, 0.02}),
    [](const auto& instance) { return std::string(instance.param.scene); });

class RedistributionEqualsPath : public testing::TestWithParam<Work> {};

struct Sharing {
  const char* name;
  RedistributionOptions redistribution;
  Drift drift;
};

/// The same for energy redistribution, whatever the threshold and the length of its chains.
TEST_P(RedistributionEqualsPath, TileMeans) {
  const Work& work = GetParam();
  const LoadedScene loaded = load_scene_of(work);
  const std::vector<test::Moments>& traced = traced_tiles(work);
  for (const Sharing& sharing : {Sharing{"default", {}, Drift::Gradient},
                                 Sharing{"short chains", {0.2, 7, 6}, Drift::None}}) {
    LangevinOptions options;
    options.max_depth = loaded.max_depth.value();
    options.redistribution = sharing.redistribution;
    options.kernel.drift = sharing.drift;
    const auto sampled = tiles_over_runs([&](std::uint64_t seed) {
      RenderOptions render;
      render.seed = seed;
      return render_langevin(loaded.scene, options, render, 40).image;
    });
    const double level = test::sidak(0.01, static_cast<int>(sampled.size()));
    std::vector<double> errors;
    for (std::size_t i = 0; i < sampled.size(); ++i) {
      errors.push_back(std::hypot(sampled[i].error(), traced[i].error()) / traced[i].mean());
      EXPECT_GT(test::welch_p_value(sampled[i], traced[i]), level)
          << sharing.name << ", tile " << i << ": langevin " << sampled[i].mean() << " +- "
          << sampled[i].error() << ", path " << traced[i].mean() << " +- " << traced[i].error();
    }
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(median(errors), work.resolution) << sharing.name;
    RecordProperty(std::string("error_") + sharing.name, std::to_string(median(errors)));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, RedistributionEqualsPath,
    testing::Values(Work{"furnace_sphere", 64, 0, 0, 0.01}, Work{"cornell_glossy", 300, 0, 0, 0.04},
                    Work{"glass_caustic", 1200, 0, 0, 0.05}, Work{"small_hole", 400, 0, 0, 0.08},
                    Work{"glossy_chain", 600, 0, 0, 0.12}, Work{"door_ajar", 200, 0, 0, 0.12},
                    Work{"ring_caustic", 300, 0, 0, 0.04}, Work{"limelight", 256, 0, 0, 0.02}),
    [](const auto& instance) { return std::string(instance.param.scene); });

/// A point behind glass and mirrors: path tracing finds nothing, and paths have coordinates from
/// both ends only. Against bidirectional path tracing, without drift and with all of it.
TEST(LangevinEqualsBdpt, PointCaustic) {
  const LoadedScene loaded = load_small("point_caustic");
  const int depth = loaded.max_depth.value();
  const auto traced = tiles_over_runs([&](std::uint64_t seed) {
    RenderOptions render;
    render.seed = 1000 + seed;
    return render_bdpt(loaded.scene, BdptOptions{depth}, render, 300).image;
  });
  const double level = test::sidak(0.01, static_cast<int>(traced.size()));
  for (const Drift drift : {Drift::None, Drift::Full}) {
    LangevinOptions options;
    options.mode = Mode::Chain;
    options.phase_space = PhaseSpace::Bidirectional;
    options.kernel.drift = drift;
    options.max_depth = depth;
    options.bootstrap = 200000;
    const auto sampled = tiles_over_runs([&](std::uint64_t seed) {
      RenderOptions render;
      render.seed = seed;
      return render_langevin(loaded.scene, options, render, 300).image;
    });
    std::vector<double> errors;
    for (std::size_t i = 0; i < sampled.size(); ++i) {
      errors.push_back(std::hypot(sampled[i].error(), traced[i].error()) / traced[i].mean());
      EXPECT_GT(test::welch_p_value(sampled[i], traced[i]), level)
          << "tile " << i << ": langevin " << sampled[i].mean() << " +- " << sampled[i].error()
          << ", bdpt " << traced[i].mean() << " +- " << traced[i].error();
    }
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(median(errors), 0.03);
  }
}

/// Rough glass and rough metal with coarse interpolated normals on a floor with bent ones, under a
/// sky with a small sun: shading normals and refraction from both ends, and no smooth surface.
Scene frosted() {
  SceneBuilder builder;
  const auto material = [&](Bsdf bsdf) {
    return builder.add_material({builder.add_bsdf(std::move(bsdf)), std::nullopt});
  };
  const auto white = material(Diffuse{Texture(Rgbd{0.7, 0.6, 0.5})});
  builder.add_shape(test::quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}, false, 0.4), white);
  const Texture clear(Rgbd{1, 1, 1});
  const Microfacets rough{Distribution::Beckmann, 0.3};
  builder.add_shape(test::round_mesh({-0.5, 0.6, 0.3}, 0.5, 6),
                    material(RoughDielectric{rough, 1.5, clear, clear}));
  const Microfacets rougher{Distribution::Ggx, 0.4};
  builder.add_shape(test::round_mesh({0.6, 0.5, -0.2}, 0.45, 5),
                    material(RoughConductor{rougher, {0.2, 0.9, 1.1}, {3.9, 2.4, 2.2}, clear}));
  builder.add_shape(test::round_mesh({0.1, 0.3, 1.0}, 0.25, 4), white);
  builder.set_environment(
      EnvironmentMap(test::sun_bitmap(32, 16, 60.0F), Eigen::Matrix3d::Identity(), 1.0));
  PerspectiveCamera camera = test::look_at({0.3, 1.6, 3.0}, {0, 0.4, 0}, 0.5);
  camera.half_height = 0.375;
  camera.film_width = 32;
  camera.film_height = 24;
  builder.set_camera(camera);
  return builder.build();
}

struct BidirectionalWork {
  const char* scene;
  int path_samples;  ///< per pixel and run
  int bdpt_samples;
  int light_samples;  ///< 0: smooth surfaces hide light from light tracing
  double resolution;  ///< as in Work
};

void PrintTo(const BidirectionalWork& work, std::ostream* out) { *out << work.scene; }

/// The caustic under a light so large that path tracing hits it often: else its rare hits would
/// make means that are not normal.
LoadedScene bidirectional_scene(const std::string& name) {
  if (name == "frosted") return {frosted(), 6, {}};
  if (name == "limelight") return {limelight(), 5, {}};
  if (name == "ring_caustic") return load_small(name, {{"alpha", "0.2"}});
  if (name == "glass_caustic") return load_small(name, {{"light", "0.6"}});
  return load_small(name);
}

class BidirectionalEqualsPath : public testing::TestWithParam<BidirectionalWork> {};

/// The same law for bidirectional path tracing, with both heuristics, and for light tracing.
TEST_P(BidirectionalEqualsPath, TileMeans) {
  const BidirectionalWork& work = GetParam();
  const LoadedScene loaded = bidirectional_scene(work.scene);
  const int depth = loaded.max_depth.value();
  const auto tiles = [&](std::uint64_t first, const auto& render_with) {
    return tiles_over_runs([&](std::uint64_t seed) {
      RenderOptions render;
      render.seed = first + seed;
      return render_with(render).image;
    });
  };
  const auto traced = tiles(1000, [&](const RenderOptions& render) {
    return render_path(loaded.scene, {depth}, render, work.path_samples);
  });
  const auto compare = [&](const std::string& name, const std::vector<test::Moments>& sampled) {
    const double level = test::sidak(0.01, static_cast<int>(sampled.size()));
    std::vector<double> errors;
    for (std::size_t i = 0; i < sampled.size(); ++i) {
      errors.push_back(std::hypot(sampled[i].error(), traced[i].error()) / traced[i].mean());
      EXPECT_GT(test::welch_p_value(sampled[i], traced[i]), level)
          << name << ", tile " << i << ": " << sampled[i].mean() << " +- " << sampled[i].error()
          << ", path " << traced[i].mean() << " +- " << traced[i].error();
    }
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(median(errors), work.resolution) << name;
    RecordProperty("error_" + name, std::to_string(median(errors)));
  };
  for (const MisHeuristic heuristic : {MisHeuristic::Balance, MisHeuristic::Power}) {
    const bool power = heuristic == MisHeuristic::Power;
    compare(power ? "power" : "balance", tiles(power ? 100 : 200, [&](const RenderOptions& render) {
              return render_bdpt(loaded.scene, {depth, heuristic}, render, work.bdpt_samples);
            }));
  }
  if (work.light_samples > 0)
    compare("light", tiles(300, [&](const RenderOptions& render) {
              return render_light(loaded.scene, {depth}, render, work.light_samples);
            }));
}

INSTANTIATE_TEST_SUITE_P(Scenes, BidirectionalEqualsPath,
                         testing::Values(BidirectionalWork{"furnace_sphere", 16, 16, 48, 0.02},
                                         BidirectionalWork{"cornell_glossy", 96, 24, 96, 0.02},
                                         BidirectionalWork{"glass_caustic", 200, 48, 0, 0.02},
                                         BidirectionalWork{"small_hole", 96, 32, 96, 0.06},
                                         BidirectionalWork{"glossy_chain", 64, 24, 0, 0.10},
                                         BidirectionalWork{"frosted", 128, 48, 128, 0.02},
                                         BidirectionalWork{"door_ajar", 200, 48, 0, 0.08},
                                         BidirectionalWork{"ring_caustic", 128, 48, 128, 0.02},
                                         BidirectionalWork{"limelight", 48, 24, 96, 0.02}),
                         [](const auto& instance) { return std::string(instance.param.scene); });

/// A closed sphere of radiance L and albedo rho shows L (1 - rho^n) / (1 - rho) everywhere.
TEST(ClosedSphere, HasItsClosedForm) {
  const LoadedScene loaded = load_small("furnace_sphere");
  const double expected = 0.5 * (1.0 - std::pow(0.5, 6)) / 0.5;
  RenderOptions render;
  const Image traced = render_path(loaded.scene, PathOptions{6}, render, 64).image;
  for (const float value : traced.rgb) EXPECT_NEAR(static_cast<double>(value), expected, 1e-4);

  LangevinOptions langevin;
  langevin.mode = Mode::Chain;
  langevin.max_depth = 6;
  langevin.bootstrap = 50000;
  const auto tiles = tiles_over_runs([&](std::uint64_t seed) {
    render.seed = seed;
    return render_langevin(loaded.scene, langevin, render, 300).image;
  });
  const double level = test::sidak(0.01, static_cast<int>(tiles.size()));
  for (const test::Moments& tile : tiles) {
    EXPECT_NEAR(tile.mean(), expected, 0.01 * expected);
    EXPECT_GT(test::student_p_value(tile, expected), level);
  }
}

/// Ratios of block means to those of an image by another renderer.
class SharedReference : public testing::Test {
 protected:
  static constexpr int kBlock = 16;

  void load(const std::string& name) {
    const std::filesystem::path shared(DRIFTLIGHT_SHARED_DIR);
    const auto file = shared / "scenes" / name / "scene.xml";
    const auto reference = shared / "references" / (name + ".exr");
    if (!std::filesystem::exists(file) || !std::filesystem::exists(reference))
      GTEST_SKIP() << "the shared scene " << name << " is not here";
    scene_.emplace(load_scene(file));
    reference_ = read_image(reference);
  }

  Image render(int samples_per_pixel, std::uint64_t seed = 1) const {
    RenderOptions options;
    options.seed = seed;
    return render_path(scene_->scene, PathOptions{scene_->max_depth.value()}, options,
                       samples_per_pixel)
        .image;
  }

  /// Ratios image / reference of the sums over the blocks of the rows [top, bottom) and the
  /// channels [first, last), sorted.
  std::vector<double> block_ratios(const Image& image, int top, int bottom, int first,
                                   int last) const {
    std::vector<double> ratios;
    for (int y = top; y + kBlock <= bottom; y += kBlock)
      for (int x = 0; x + kBlock <= image.width; x += kBlock)
        ratios.push_back(block_sum(image, x, y, first, last) /
                         block_sum(reference_, x, y, first, last));
    std::sort(ratios.begin(), ratios.end());
    return ratios;
  }
  std::vector<double> block_ratios(const Image& image) const {
    return block_ratios(image, 0, image.height, 0, 3);
  }

  std::optional<LoadedScene> scene_;
  Image reference_;

 private:
  static double block_sum(const Image& image, int left, int top, int first, int last) {
    double sum = 0;
    for (int y = top; y < top + kBlock; ++y)
      for (int x = left; x < left + kBlock; ++x)
        for (int c = first; c < last; ++c) sum += static_cast<double>(image.pixel(x, y)[c]);
    return sum;
  }
};

TEST_F(SharedReference, CboxGlossy) {
  ASSERT_NO_FATAL_FAILURE(load("cbox_glossy"));
  if (IsSkipped()) return;
  const Image image = render(192);
  EXPECT_NEAR(median(block_ratios(image)), 1.0, 0.01);
  EXPECT_NEAR(difference(image, reference_).mean, 1.0, 0.01);
}

/// Path tracing is unbiased with independent samples: relMSE falls as 1 / N.
TEST_F(SharedReference, ErrorFallsAsOneOverN) {
  ASSERT_NO_FATAL_FAILURE(load("cbox_glossy"));
  if (IsSkipped()) return;
  const double few = difference(render(4), reference_).relmse;
  const double many = difference(render(64), reference_).relmse;
  EXPECT_GT(few / many, 10.0);
  EXPECT_LT(few / many, 25.0);
}

/// The reference's light has another colour than the spectrum in the file integrates to: by one
/// factor a channel for the whole image, whatever the number of bounces. The rest must agree.
TEST_F(SharedReference, CboxUpToTheColourOfItsLight) {
  ASSERT_NO_FATAL_FAILURE(load("cbox"));
  if (IsSkipped()) return;
  const Image image = render(144);
  for (int c = 0; c < 3; ++c) {
    const double all = median(block_ratios(image, 0, image.height, c, c + 1));
    // From the lit ceiling down to the floor, which light reaches after more bounces.
    for (int quarter = 0; quarter < 4; ++quarter) {
      const int height = image.height / 4;
      const double part =
          median(block_ratios(image, quarter * height, (quarter + 1) * height, c, c + 1));
      EXPECT_NEAR(part / all, 1.0, 0.01) << "channel " << c << ", quarter " << quarter;
    }
  }
}

TEST_F(SharedReference, Torus) {
  ASSERT_NO_FATAL_FAILURE(load("torus"));
  if (IsSkipped()) return;
  EXPECT_NEAR(median(block_ratios(render(300))), 1.0, 0.01);
}

}  // namespace
}  // namespace driftlight
