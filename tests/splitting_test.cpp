// SPDX-License-Identifier: Apache-2.0
/// Laws of tempered splitting and its levels. That its images are right is for the slow tests.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "driftlight/contribution.h"
#include "driftlight/gradient_check.h"
#include "driftlight/phase_space.h"
#include "driftlight/render.h"
#include "driftlight/scene_check.h"
#include "family_tiles.h"
#include "lobe_sequence.h"
#include "softened_bsdf.h"
#include "support/scene_directory.h"
#include "support/test_scenes.h"
#include "support/tiles.h"
#include "tempered_scenes.h"

namespace driftlight::test {
namespace {

/// A sky of radiance 1 with a Gaussian sun of standard deviation sigma, about the +z axis of the
/// map's equator.
EnvironmentMap gaussian_sun(int height, double sigma, double peak) {
  Bitmap bitmap{2 * height, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < bitmap.width; ++x) {
      const double theta = kPi * (y + 0.5) / height;
      const double phi = 2.0 * kPi * (x + 0.5) / bitmap.width;
      const double cosine = -std::sin(theta) * std::cos(phi);
      const double light = 1.0 + peak * std::exp((cosine - 1.0) / (sigma * sigma));
      bitmap.texels.emplace_back(Eigen::Array3f::Constant(static_cast<float>(light)));
    }
  }
  return {std::move(bitmap), Eigen::Matrix3d::Identity(), 1.0};
}

/// A Gaussian sun has int L^n = peak^n 2 pi sigma^2 / n, so (int L^2)^3 / (int L^3)^2 is
/// 2 pi sigma^2 9 / 8.
TEST(EnvironmentBlur, KnowsTheSizeOfTheSun) {
  for (const double sigma : {0.05, 0.1})
    EXPECT_NEAR(gaussian_sun(256, sigma, 1e6).peak_solid_angle(), 2.25 * kPi * sigma * sigma,
                0.02 * sigma * sigma * kPi);
}

/// Of the sun, along each axis: E[1 - cos gamma], as E[gamma^2 / 2] = sigma^2.
double variance(const EnvironmentMap& sun) {
  const Bitmap& map = sun.bitmap();
  double sum = 0.0;
  double moment = 0.0;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double theta = kPi * (y + 0.5) / map.height;
      const double phi = 2.0 * kPi * (x + 0.5) / map.width;
      const double light = std::sin(theta) * (static_cast<double>(map.at(x, y)[0]) - 1.0);
      sum += light;
      moment += light * (1.0 + std::sin(theta) * std::cos(phi));
    }
  }
  return moment / sum;
}

TEST(EnvironmentBlur, AddsVariancesAndKeepsEnergy) {
  const EnvironmentMap sun = gaussian_sun(256, 0.05, 1e6);
  const EnvironmentMap blurred = sun.blurred(0.12);
  EXPECT_LT(blurred.bitmap().height, 60);
  EXPECT_NEAR(blurred.total_luminance() / sun.total_luminance(), 1.0, 0.02);
  EXPECT_NEAR(variance(blurred), 0.05 * 0.05 + 0.12 * 0.12, 0.0005);
}

TEST(EnvironmentMap, PrecisionIsThatOfTheSun) {
  const double sigma = 0.05;
  const EnvironmentMap sun = gaussian_sun(256, sigma, 1e6);
  const auto width = [&](double angle) {
    return 1.0 / std::sqrt(sun.precision(Vec3d(std::sin(angle), 0.0, std::cos(angle))));
  };
  EXPECT_NEAR(width(0.0), sigma, 0.3 * sigma);
  EXPECT_NEAR(width(sigma), sigma, 0.6 * sigma);
  // Away from it, less than the distance; and the far sky does not bind.
  EXPECT_LT(width(0.5), 0.5);
  EXPECT_GT(width(0.5), 0.05);
  const EnvironmentMap even({64, 32, std::vector(64 * 32, Eigen::Array3f(1, 1, 1))},
                            Eigen::Matrix3d::Identity(), 1.0);
  EXPECT_EQ(even.precision(Vec3d(0.6, 0.0, 0.8)), 1.0);
}

/// sun_pane under a wide sun in a small map.
Scene pane() { return load_small("sun_pane").scene.with_emitters({gaussian_sun(64, 0.03, 5e4)}); }

const EnvironmentMap& sky_of(const Scene& scene) {
  return std::get<EnvironmentMap>(scene.emitters()[*scene.environment()]);
}

/// Each level is positive where the next sharper one is, and nowhere far darker.
TEST(TemperedScenes, SoftenInSteps) {
  const Scene scene = pane();
  const TemperedScenes levels(scene, std::nullopt);
  EXPECT_EQ(&levels[0], &scene);
  EXPECT_EQ(levels.top(), 4);
  for (int k = 1; k <= levels.top(); ++k) {
    const EnvironmentMap& sharper = sky_of(levels[k - 1]);
    const EnvironmentMap& softer = sky_of(levels[k]);
    double most = 0.0;
    for (std::uint64_t i = 0; i < 20000; ++i) {
      Rng rng(1, Stream::Test, i);
      const Vec3d d = sharper.sample(rng.uniform(), rng.uniform());
      const double light = luminance(sharper.eval(d));
      if (light > 0.0) most = std::max(most, light / luminance(softer.eval(d)));
    }
    EXPECT_LT(most, 9.0) << "level " << k;
    EXPECT_GT(softer.peak_solid_angle(), 1.5 * sharper.peak_solid_angle()) << "level " << k;
  }
}

/// A sun of one texel in a black sky: beyond it levels are black too, and within it none is.
TEST(TemperedScenes, ArePositiveWhereverTheSceneIs) {
  Bitmap bitmap{32, 16, std::vector(32 * 16, Eigen::Array3f(0, 0, 0))};
  bitmap.texels[5 * 32 + 7] = {9.0F, 8.0F, 7.0F};
  const Scene scene =
      pane().with_emitters({EnvironmentMap(bitmap, Eigen::Matrix3d::Identity(), 1.0)});
  const TemperedScenes levels(scene, 5);
  for (int k = 1; k <= levels.top(); ++k) {
    const EnvironmentMap& sharper = sky_of(levels[k - 1]);
    for (std::uint64_t i = 0; i < 5000; ++i) {
      Rng rng(1, Stream::Test, i);
      const Vec3d d = sharper.sample(rng.uniform(), rng.uniform());
      const bool light = luminance(sharper.eval(d)) > 0.0;
      ASSERT_TRUE(!light || luminance(sky_of(levels[k]).eval(d)) > 0.0) << "level " << k;
    }
  }
}

/// A lamp in glass that rays from the sensor hit often enough.
LoadedScene wide_lamp() { return load_small("lamp_in_glass", {{"filament", "0.05"}}); }

/// Paths that a ray to the lamp ends behind glass.
std::vector<PathSampler::Sample> paths_to_lamp(const LoadedScene& loaded, std::size_t count) {
  std::vector<PathSampler::Sample> paths;
  for (std::uint64_t i = 0; paths.size() < count; ++i) {
    const auto path =
        draw_light_path(loaded.scene, loaded.max_depth.value(), 3, i, PhaseSpace::Directions);
    if (path && path->topology.end == PathEnd::Hit && path->topology.length() > 1)
      paths.push_back(*path);
  }
  return paths;
}

/// A path of the scene is one of all levels, where nothing stands in its way that does not in the
/// scene, and nowhere far darker.
void expect_lit_at_all_levels(const Scene& scene, const std::vector<PathSampler::Sample>& paths) {
  const TemperedScenes levels(scene, 4);
  ASSERT_EQ(levels.top(), 4);
  for (const PathSampler::Sample& path : paths) {
    const auto sharp = levels.at_level_0(path.topology, path.coordinates);
    ASSERT_TRUE(sharp && levels.carry(*sharp));
    double before = contribution(scene, *sharp, path.coordinates).log_target;
    for (int k = 1; k <= levels.top(); ++k) {
      PathTopology traced;
      ASSERT_EQ(trace(levels[k], path.topology, path.coordinates, traced), TraceStatus::Ok);
      const double here = contribution(levels[k], traced, path.coordinates).log_target;
      EXPECT_LT(before - here, std::log(8.0)) << "level " << k;
      before = here;
    }
  }
}

TEST(TemperedScenes, LampsShineWhereverTheSceneIsLit) {
  const LoadedScene loaded = wide_lamp();
  expect_lit_at_all_levels(loaded.scene, paths_to_lamp(loaded, 200));
}

/// Jets, derivatives by hand and differences agree at all levels; how many were compared.
int check_derivatives(const Scene& scene, int count,
                      const std::vector<PathSampler::Sample>& paths) {
  const TemperedScenes levels(scene, count);
  int compared = 0;
  for (const PathSampler::Sample& path : paths)
    for (int k = 1; k <= levels.top(); ++k) {
      const PathCheck check = check_path(levels[k], path.topology, path.coordinates);
      for (const Quantity quantity : kQuantities) {
        EXPECT_TRUE(check[quantity].passes(quantity))
            << name(quantity) << " at level " << k << ": " << check[quantity].error;
        compared += check[quantity].compared;
      }
    }
  return compared;
}

TEST(TemperedScenes, DerivativesFollowBlurredLamps) {
  const LoadedScene loaded = wide_lamp();
  EXPECT_GT(check_derivatives(loaded.scene, 3, paths_to_lamp(loaded, 60)), 1000);
}

/// A lamp of a shape and radiance in a globe of glass, on a floor.
LoadedScene globe_with(const std::string& shape, const std::string& radiance) {
  const SceneDirectory directory;
  const std::string place =
      R"(<transform name="toWorld"><scale value="0.1"/><rotate x="1" y="1" angle="145"/>)"
      R"(<translate z="3"/></transform>)";
  return directory.load(with_sensor(
      R"(<integrator type="path"><integer name="maxDepth" value="5"/></integrator>)"
      R"(<shape type="rectangle"><transform name="toWorld"><scale value="4"/>)"
      R"(<rotate x="1" angle="-90"/><translate y="-0.6" z="3"/></transform></shape>)"
      R"(<shape type="sphere"><point name="center" x="0" y="0" z="3"/><float name="radius" value="0.4"/>)"
      R"(<bsdf type="dielectric"/></shape><shape type=")" +
      shape + "\">" + place + R"(<emitter type="area">)" + radiance + "</emitter></shape>"));
}

/// Blurred lamps know no shape but their extent, and the colour that a path meets on the lamp.
TEST(TemperedScenes, LampsOfAnyShapeShineWhereverTheSceneIsLit) {
  const std::string even = R"(<spectrum name="radiance" value="50"/>)";
  const std::string textured =
      R"(<texture name="radiance" type="checkerboard"><rgb name="color0" value="90, 20, 5"/>)"
      R"(<rgb name="color1" value="10, 30, 70"/></texture>)";
  const std::pair<std::string, std::string> lamps[] = {
      {"disk", even}, {"cylinder", even}, {"cube", even}, {"rectangle", textured}};
  for (const auto& [shape, radiance] : lamps) {
    SCOPED_TRACE(shape);
    const LoadedScene loaded = globe_with(shape, radiance);
    expect_lit_at_all_levels(loaded.scene, paths_to_lamp(loaded, 60));
    EXPECT_GT(check_derivatives(loaded.scene, 3, paths_to_lamp(loaded, 10)), 100);
  }
}

/// Paths with narrow lobes, with coordinates from both ends.
std::vector<PathSampler::Sample> paths_through_block(const LoadedScene& loaded, std::size_t count) {
  std::vector<PathSampler::Sample> paths;
  for (std::uint64_t i = 0; paths.size() < count; ++i) {
    const auto path =
        draw_light_path(loaded.scene, loaded.max_depth.value(), 3, i, PhaseSpace::Bidirectional);
    if (path && path->topology.length() > 2) paths.push_back(*path);
  }
  return paths;
}

TEST(TemperedScenes, DerivativesFollowTheRoughness) {
  const LoadedScene loaded = load_small("glass_block", {{"alpha", "0.009"}});
  EXPECT_GT(check_derivatives(loaded.scene, 3, paths_through_block(loaded, 60)), 1000);
}

/// Twice the scene's at the first level, then about twice that of the level before; and a path of
/// the scene is one of all levels, and nowhere far darker.
TEST(TemperedScenes, RoughnessGrowsInSteps) {
  const LoadedScene loaded = load_small("glass_block", {{"alpha", "0.009"}});
  const TemperedScenes levels(loaded.scene, std::nullopt);
  const auto roughness = [&](int k) {
    double least = kInfinity;
    for (const Bsdf& bsdf : levels[k].bsdfs()) least = std::min(least, least_roughness(bsdf));
    return least;
  };
  const double step = std::numbers::sqrt2;
  ASSERT_EQ(levels.top(), 10);
  EXPECT_EQ(roughness(0), 0.009);
  EXPECT_DOUBLE_EQ(roughness(1), 0.009 * step);
  EXPECT_DOUBLE_EQ(roughness(10), 0.3);
  for (int k = 1; k <= levels.top(); ++k) EXPECT_LT(roughness(k) / roughness(k - 1), 1.05 * step);
  for (const PathSampler::Sample& path : paths_through_block(loaded, 200)) {
    ASSERT_TRUE(levels.carry(path.topology));
    double before = contribution(loaded.scene, path.topology, path.coordinates).log_target;
    for (int k = 1; k <= levels.top(); ++k) {
      const double here = contribution(levels[k], path.topology, path.coordinates).log_target;
      EXPECT_LT(before - here, path.topology.scatter_count * std::log(3.0)) << "level " << k;
      before = here;
    }
  }
}

TEST(TemperedScenes, LeaveWideLobesAlone) {
  const LoadedScene loaded = load_small("glass_block", {{"alpha", "0.1"}});
  EXPECT_EQ(TemperedScenes(loaded.scene, std::nullopt).top(), 0);
  EXPECT_EQ(TemperedScenes(loaded.scene, 2).top(), 0);
}

TEST(SoftenedBsdf, IsAsRoughAsAskedFor) {
  const RoughConductor metal{.microfacets = {Distribution::Ggx, 0.01, 0.2}};
  const auto rough = std::get<RoughConductor>(softened(metal, 0.05));
  EXPECT_EQ(rough.microfacets.alpha_u, 0.05);
  EXPECT_EQ(rough.microfacets.alpha_v, 0.2);
  // A blend does not change what it shares.
  const auto box = [](const Bsdf& bsdf) { return std::make_shared<const BsdfBox>(BsdfBox{bsdf}); };
  const Blend blend{.first = box(metal), .second = box(Diffuse{})};
  const Bsdf all[] = {metal,
                      Phong{.exponent = 2000},
                      Ward{.alpha_u = 0.3, .alpha_v = 0.02},
                      RoughDielectric{.microfacets = {Distribution::Beckmann, 0.01}},
                      Coating{.nested = box(metal)},
                      Mask{.nested = box(Bsdf(blend))}};
  for (const Bsdf& bsdf : all) {
    const double least = least_roughness(bsdf);
    EXPECT_LT(least, 0.05);
    EXPECT_NEAR(least_roughness(softened(bsdf, 0.05)), 0.05, 1e-12);
    EXPECT_NEAR(least_roughness(softened(bsdf, 0.5 * least)), least, 1e-12);
    EXPECT_EQ(least_roughness(bsdf), least);
  }
  for (const Bsdf& smooth : {Bsdf(Diffuse{}), Bsdf(Conductor{}), Bsdf(Mask{})})
    EXPECT_EQ(least_roughness(smooth), kInfinity);
}

/// The power that a lamp sends toward a point is about that of the lamp itself at all levels.
TEST(BlurredAreaEmitter, KeepsItsPower) {
  LampExtent lamp;
  lamp.variance = Vec3d(4e-4, 1e-4, 0.0);
  lamp.normal = Vec3d::UnitZ();
  lamp.spread = 4.0;
  lamp.reach = 0.05;
  const Vec3d origin(0.3, -0.2, 1.0);
  const double distance = origin.norm();
  const double cosine = origin.z() / distance;
  // A disk of semi-axes 0.04 and 0.02.
  const double truth = kPi * 0.04 * 0.02 * cosine / (distance * distance);
  for (const double sigma : {0.005, 0.02, 0.08}) {
    const BlurredAreaEmitter blurred(AreaEmitter{}, lamp, sigma);
    double sum = 0.0;
    const int n = 400;
    const double half = 5.0 * (sigma + 0.04);
    const TangentBasis basis = tangent_basis(Vec3d(-origin / distance));
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const double x = half * (2.0 * (i + 0.5) / n - 1.0);
        const double y = half * (2.0 * (j + 0.5) / n - 1.0);
        const Vec3d v = -origin / distance + x * basis.t + y * basis.b;
        const Ray<double> ray{origin, v.normalized()};
        if (blurred.shines(ray)) sum += std::exp(blurred.log_share(ray)) * std::pow(v.norm(), -3.0);
      }
    EXPECT_NEAR(sum * std::pow(2.0 * half / n, 2) / truth, 1.0, 0.03) << sigma;
  }
  EXPECT_FALSE(BlurredAreaEmitter(AreaEmitter{}, lamp, 0.1).shines({-origin, origin / distance}));
}

TEST(TemperedScenes, AreAsManyAsAskedForAndNoneForAnEvenSky) {
  const Scene scene = pane();
  for (const int count : {0, 1, 3}) EXPECT_EQ(TemperedScenes(scene, count).top(), count);
  EXPECT_EQ(TemperedScenes(load_small("cornell_glossy").scene, std::nullopt).top(), 0);
}

TEST(LobeSequence, TellsTopologiesApart) {
  PathTopology path;
  path.scatter_count = 2;
  const LobeSequence plain(path);
  PathTopology other = path;
  other.emitter = 3;
  EXPECT_EQ(plain, LobeSequence(other));
  other.vertices[1].delta = true;
  EXPECT_NE(plain, LobeSequence(other));
  other = path;
  other.vertices[0].scattering = Scattering::Transmission;
  EXPECT_NE(plain, LobeSequence(other));
  other = path;
  other.scatter_count = 3;
  EXPECT_NE(plain, LobeSequence(other));
  other = path;
  other.end = PathEnd::Environment;
  EXPECT_NE(plain, LobeSequence(other));
}

LangevinResult render(const Scene& scene, const LangevinOptions& options, int threads) {
  RenderOptions render;
  render.threads = threads;
  render.seed = 5;
  return render_langevin(scene, options, render, 4);
}

LangevinOptions splitting() {
  LangevinOptions options;
  options.mode = Mode::Splitting;
  options.max_depth = 6;
  options.redistribution.pilot = 8192;
  options.splitting.pilot = 512;
  options.splitting.all = true;
  return options;
}

TEST(Splitting, DoesNotDependOnThreads) {
  const Scene scene = pane();
  const LangevinResult one = render(scene, splitting(), 1);
  ASSERT_EQ(one.statistics.levels.size(), 5U);
  EXPECT_GT(one.statistics.levels[4].particles, 10U);
  EXPECT_GT(one.statistics.split, 0.0);
  EXPECT_GT(one.statistics.effective_families, 1.0);
  for (const int threads : {2, 4}) {
    const LangevinResult other = render(scene, splitting(), threads);
    EXPECT_EQ(one.image.rgb, other.image.rgb);
    EXPECT_EQ(one.statistics.mutations, other.statistics.mutations);
    EXPECT_EQ(one.statistics.effective_families, other.statistics.effective_families);
  }
}

/// Samples, chains and particles add up to the image, and families are counted where particles are.
TEST(Splitting, SharesAddUpToTheImage) {
  const Scene scene = pane();
  Layers shares;
  RenderOptions how;
  how.seed = 5;
  how.shares = &shares;
  const LangevinResult result = render_langevin(scene, splitting(), how, 4);
  ASSERT_EQ(shares.names,
            (std::vector<std::string>{"samples.R", "samples.G", "samples.B", "chains.R", "chains.G",
                                      "chains.B", "particles.R", "particles.G", "particles.B",
                                      "families"}));
  EXPECT_EQ(result.image.rgb, render(scene, splitting(), 2).image.rgb);
  const std::size_t channels = shares.names.size();
  ASSERT_EQ(shares.values.size(), result.image.rgb.size() / 3 * channels);
  double particles = 0.0;
  for (std::size_t pixel = 0; pixel < shares.values.size() / channels; ++pixel) {
    const float* value = &shares.values[pixel * channels];
    for (std::size_t c = 0; c < 3; ++c)
      ASSERT_FLOAT_EQ(value[c] + (value[3 + c] + value[6 + c]), result.image.rgb[3 * pixel + c]);
    const Rgbd by_particles = Eigen::Array3f(value[6], value[7], value[8]).cast<double>();
    ASSERT_TRUE(luminance(by_particles) == 0.0 || value[9] > 0.999F);
    particles += luminance(by_particles);
  }
  const LangevinStatistics& statistics = result.statistics;
  EXPECT_NEAR(particles * 3.0 / static_cast<double>(result.image.rgb.size()) / statistics.split,
              1.0, 1e-5);
  EXPECT_GT(statistics.split_of_few_families, 0.0);
  EXPECT_LE(statistics.split_of_few_families, statistics.split * (1.0 + 1e-6));
}

/// Of families with equal sums their number; (1 + 3)^2 / (1 + 9) of two others.
TEST(FamilyTiles, CountWhatANumberOfEqualFamiliesWouldBe) {
  FamilyTiles tiles(40, 20);
  const int first = tiles.at(Vec2d(0.1, 0.2));
  const int last = tiles.at(Vec2d(0.99, 0.99));
  EXPECT_NE(first, last);
  EXPECT_EQ(tiles.at(Vec2d(0.81, 0.81)), last);
  for (int i = 0; i < 7; ++i) tiles.add(first, 0.5);
  tiles.add(last, 1.0);
  tiles.add(last, 3.0);
  EXPECT_NEAR(tiles.effective(0, 0), 7.0, 1e-5);
  EXPECT_NEAR(tiles.effective(15, 15), 7.0, 1e-5);
  EXPECT_NEAR(tiles.effective(39, 19), 1.6, 1e-5);
  EXPECT_EQ(tiles.effective(16, 0), 0.0);
  Image grey(40, 20);
  for (float& x : grey.rgb) x = 2.0F;
  EXPECT_NEAR(tiles.luminance_of_fewer(5.0, grey), 2.0 * (800.0 - 256.0) / 800.0, 1e-5);
  EXPECT_EQ(tiles.luminance_of_fewer(0.0, grey), 0.0);
}

/// Where a scene has nothing sharp, or no levels are wanted, it is redistribution, bit for bit.
TEST(Splitting, WithoutLevelsIsRedistribution) {
  LangevinOptions options = splitting();
  options.splitting.levels = 0;
  const Scene scene = pane();
  LangevinOptions redistribution = splitting();
  redistribution.mode = Mode::Redistribution;
  EXPECT_EQ(render(scene, options, 2).image.rgb, render(scene, redistribution, 2).image.rgb);
  const Scene room = load_small("cornell_glossy").scene;
  const LangevinResult result = render(room, splitting(), 2);
  EXPECT_EQ(result.image.rgb, render(room, redistribution, 2).image.rgb);
  EXPECT_EQ(result.statistics.split_sequences, 0U);
}

}  // namespace
}  // namespace driftlight::test
