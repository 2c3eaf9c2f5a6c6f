// SPDX-License-Identifier: Apache-2.0
/// Whole images: bidirectional and light tracing against path tracing, closed forms, and images of
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
#include "support/places.h"
#include "support/t_test.h"
#include "support/test_scenes.h"
#include "support/tiles.h"

namespace driftlight {
namespace {

using test::limelight;
using test::load_small;
using test::tiles_over_runs;

double median(const std::vector<double>& sorted) { return sorted[sorted.size() / 2]; }

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
  Camera camera = test::look_at({0.3, 1.6, 3.0}, {0, 0.4, 0}, 0.5);
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
  double resolution;  ///< of expect_equal_tiles
};

void PrintTo(const BidirectionalWork& work, std::ostream* out) { *out << work.scene; }

/// The caustic under a light so large that path tracing hits it often: else its rare hits would
/// make means that are not normal.
LoadedScene bidirectional_scene(const std::string& name) {
  if (name == "frosted") return {frosted(), 6, {}, {}};
  if (name == "limelight") return {limelight(), 5, {}, {}};
  if (name == "coated") return {test::coated(false), 5, {}, {}};
  if (name == "plan") return {test::plan(false), 5, {}, {}};
  if (name == "lens") return {test::lens(false), 5, {}, {}};
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
    test::expect_equal_tiles(name, sampled, traced, work.resolution);
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
                                         BidirectionalWork{"limelight", 48, 24, 96, 0.02},
                                         BidirectionalWork{"coated", 96, 24, 0, 0.04},
                                         BidirectionalWork{"plan", 96, 24, 0, 0.04},
                                         BidirectionalWork{"lens", 64, 24, 96, 0.04}),
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
    const std::filesystem::path shared = test::shared_folder();
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
  const Image image = render(96);
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

/// Each channel, from the lit ceiling down to the floor, which light reaches after more bounces.
TEST_F(SharedReference, Cbox) {
  ASSERT_NO_FATAL_FAILURE(load("cbox"));
  if (IsSkipped()) return;
  const Image image =
      render_bdpt(scene_->scene, {.max_depth = scene_->max_depth.value()}, {}, 64).image;
  EXPECT_NEAR(difference(image, reference_).mean, 1.0, 0.005);
  for (int c = 0; c < 3; ++c)
    for (int quarter = 0; quarter < 4; ++quarter) {
      const int height = image.height / 4;
      const double ratio =
          median(block_ratios(image, quarter * height, (quarter + 1) * height, c, c + 1));
      EXPECT_NEAR(ratio, 1.0, 0.005) << "channel " << c << ", quarter " << quarter;
    }
}

/// The reference has a grain of its own, which hardly shows in means: that of the image is within
/// 0.4 % of the reference's for each of four seeds.
TEST_F(SharedReference, Torus) {
  ASSERT_NO_FATAL_FAILURE(load("torus"));
  if (IsSkipped()) return;
  const Image image = render(150);
  EXPECT_NEAR(median(block_ratios(image)), 1.0, 0.01);
  EXPECT_NEAR(difference(image, reference_).mean, 1.0, 0.01);
}

}  // namespace
}  // namespace driftlight
