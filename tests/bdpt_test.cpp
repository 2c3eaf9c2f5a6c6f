// SPDX-License-Identifier: Apache-2.0
/// Laws of the images of bidirectional path tracing and light tracing.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "driftlight/error.h"
#include "driftlight/render.h"
#include "driftlight/scene_file.h"
#include "support/places.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

double mean(const Image& image) {
  double sum = 0;
  for (const float x : image.rgb) sum += static_cast<double>(x);
  return sum / static_cast<double>(image.rgb.size());
}

/// Mean of the channels of a strategy.
double mean(const Layers& layers, const std::string& strategy) {
  double sum = 0;
  for (std::size_t i = 0; i < layers.values.size(); ++i) {
    const std::string& name = layers.names[i % layers.names.size()];
    if (name.substr(0, name.size() - 2) == strategy) sum += static_cast<double>(layers.values[i]);
  }
  return sum / (3.0 * layers.width * layers.height);
}

std::string name_of(int s, int t) { return "s" + std::to_string(s) + "t" + std::to_string(t); }

// Law: inside a closed diffuse sphere of albedo rho that emits L = 1, paths of n edges bring
// rho^(n - 1) to each pixel, the strategies of that length together. All of them take part.
TEST(Bdpt, ClosedFurnaceByLength) {
  const double albedo = 0.6;
  const int max_depth = 5;
  const Scene scene = furnace(albedo);
  for (const MisHeuristic heuristic : {MisHeuristic::Balance, MisHeuristic::Power}) {
    std::array<Moments, max_depth> lengths;
    Moments total;
    std::vector<double> shares(20, 0.0);
    for (std::uint64_t run = 0; run < 12; ++run) {
      Layers strategies;
      RenderOptions render;
      render.seed = run;
      render.strategies = &strategies;
      total.add(mean(render_bdpt(scene, {max_depth, heuristic}, render, 12).image));
      std::size_t strategy = 0;
      for (int n = 1; n <= max_depth; ++n) {
        double sum = 0;
        for (int t = n == 1 ? 2 : 1; t <= n + 1; ++t) {
          const double share = mean(strategies, name_of(n + 1 - t, t));
          shares[strategy++] += share;
          sum += share;
        }
        lengths[static_cast<std::size_t>(n - 1)].add(sum);
      }
    }
    const double level = sidak(0.01, max_depth + 1);
    const double expected = (1.0 - std::pow(albedo, max_depth)) / (1.0 - albedo);
    EXPECT_GT(student_p_value(total, expected), level) << total.mean() << " " << expected;
    EXPECT_LT(total.error(), 0.01 * expected);
    EXPECT_NEAR(lengths[0].mean(), 1.0, 1e-6);
    for (int n = 2; n <= max_depth; ++n) {
      const Moments& length = lengths[static_cast<std::size_t>(n - 1)];
      EXPECT_GT(student_p_value(length, std::pow(albedo, n - 1)), level) << n << " edges";
      EXPECT_LT(length.error(), 0.02 * std::pow(albedo, n - 1)) << n << " edges";
    }
    for (std::size_t i = 0; i < (max_depth * (max_depth + 3)) / 2 - 1; ++i)
      EXPECT_GT(shares[i], 0.0) << i;
  }
}

TEST(LightTracing, ClosedFurnace) {
  const double albedo = 0.6;
  const int max_depth = 5;
  const Scene scene = furnace(albedo);
  Moments total;
  for (std::uint64_t run = 0; run < 12; ++run) {
    RenderOptions render;
    render.seed = run;
    total.add(mean(render_light(scene, {max_depth}, render, 24).image));
  }
  const double expected = (1.0 - std::pow(albedo, max_depth)) / (1.0 - albedo);
  EXPECT_GT(student_p_value(total, expected), 0.01) << total.mean() << " " << expected;
  EXPECT_LT(total.error(), 0.01 * expected);
  // What is seen directly has no noise.
  EXPECT_NEAR(mean(render_light(scene, {1}, RenderOptions{}, 1).image), 1.0, 1e-6);
}

/// An image of 48 x 40 pixels, so that several tasks splat onto each other.
LoadedScene load_small(const std::string& name) {
  LoadOptions options;
  options.defines = {{"width", "48"}, {"height", "40"}};
  return load_scene(test::own_scene(name), options);
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

// Law: threads do not show, neither in the image nor in its strategies.
TEST(Bdpt, ThreadsDoNotShow) {
  const LoadedScene loaded = load_small("glass_caustic");
  Layers strategies;
  RenderOptions render;
  render.strategies = &strategies;
  const auto image = [&](int threads, std::uint64_t seed) {
    render.threads = threads;
    render.seed = seed;
    return render_bdpt(loaded.scene, {.max_depth = 5}, render, 2).image.rgb;
  };
  const std::vector<float> expected = image(1, 3);
  const std::vector<float> layers = strategies.values;
  for (const int threads : {1, 2}) {
    EXPECT_TRUE(same_bits(image(threads, 3), expected)) << threads;
    EXPECT_TRUE(same_bits(strategies.values, layers)) << threads;
  }
  EXPECT_FALSE(same_bits(image(2, 4), expected));
  render.strategies = nullptr;
  EXPECT_TRUE(same_bits(image(2, 3), expected));
}

TEST(LightTracing, ThreadsDoNotShow) {
  const LoadedScene loaded = load_small("cornell_glossy");
  const auto image = [&](int threads, std::uint64_t seed) {
    RenderOptions render;
    render.threads = threads;
    render.seed = seed;
    return render_light(loaded.scene, {.max_depth = 5}, render, 2).image.rgb;
  };
  const std::vector<float> expected = image(1, 3);
  for (const int threads : {1, 2}) EXPECT_TRUE(same_bits(image(threads, 3), expected));
  EXPECT_FALSE(same_bits(image(2, 4), expected));
}

// Law: the strategies' images are named as promised and add up to the image.
TEST(Bdpt, StrategiesAddUpToTheImage) {
  const LoadedScene loaded = load_small("glass_caustic");
  const int max_depth = 6;
  Layers strategies;
  RenderOptions render;
  render.strategies = &strategies;
  const PathResult result = render_bdpt(loaded.scene, {.max_depth = max_depth}, render, 3);
  EXPECT_EQ(result.samples_per_pixel, 3.0);
  EXPECT_EQ(result.non_finite, 0U);

  std::vector<std::string> names{"s0t2.R", "s0t2.G", "s0t2.B"};
  for (int n = 2; n <= max_depth; ++n)
    for (int t = 1; t <= n + 1; ++t)
      for (const char* channel : {".R", ".G", ".B"})
        names.push_back(name_of(n + 1 - t, t) + channel);
  ASSERT_EQ(strategies.names, names);
  EXPECT_EQ(names.size(), 3U * (max_depth * (max_depth + 3) / 2 - 1));
  ASSERT_EQ(strategies.values.size(), names.size() * 48U * 40U);
  for (std::size_t pixel = 0; pixel < 48U * 40U; ++pixel) {
    std::array<double, 3> sum{};
    for (std::size_t i = 0; i < names.size(); ++i)
      sum.at(i % 3) += static_cast<double>(strategies.values[pixel * names.size() + i]);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto value = static_cast<double>(result.image.rgb[3 * pixel + c]);
      EXPECT_NEAR(sum.at(c), value, 1e-6 * (1.0 + value));
    }
  }
  // The caustic is light through glass that the floor shows to the sensor.
  EXPECT_GT(mean(strategies, "s4t1"), 0.0);
}

/// Means over the quarters of an image, from runs of their own.
template <class Render>
std::vector<Moments> quarters_over_runs(const Render& render, int runs) {
  std::vector<Moments> quarters(4);
  for (int run = 0; run < runs; ++run) {
    const Image image = render(static_cast<std::uint64_t>(run));
    std::array<double, 4> sums{};
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        const float* p = image.pixel(x, y);
        const int quarter = 2 * (2 * y / image.height) + 2 * x / image.width;
        sums.at(static_cast<std::size_t>(quarter)) += luminance(
            Rgbd(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])));
      }
    for (std::size_t i = 0; i < 4; ++i) quarters[i].add(sums.at(i));
  }
  return quarters;
}

// Law: the heuristic does not show in the mean, and both show what path tracing shows, in scenes
// with every BSDF, shape and emitter.
TEST(Bdpt, HeuristicsAndPathTracingAgree) {
  const int runs = 12;
  std::vector<double> p_values;
  std::vector<double> errors;
  for (const TestScene& test : test_scenes()) {
    const auto bidirectional = [&](MisHeuristic heuristic, std::uint64_t first) {
      return quarters_over_runs(
          [&](std::uint64_t run) {
            RenderOptions render;
            render.seed = first + run;
            return render_bdpt(test.scene, {test.max_depth, heuristic}, render, 6).image;
          },
          runs);
    };
    const auto power = bidirectional(MisHeuristic::Power, 0);
    const auto balance = bidirectional(MisHeuristic::Balance, 100);
    const auto path = quarters_over_runs(
        [&](std::uint64_t run) {
          RenderOptions render;
          render.seed = 200 + run;
          return render_path(test.scene, {test.max_depth}, render, 24).image;
        },
        runs);
    for (std::size_t i = 0; i < path.size(); ++i) {
      p_values.push_back(welch_p_value(power[i], balance[i]));
      p_values.push_back(welch_p_value(power[i], path[i]));
      errors.push_back(power[i].error() / power[i].mean());
      const double level = sidak(0.01, 32);
      EXPECT_GT(p_values[p_values.size() - 2], level)
          << test.name << ", quarter " << i << ": power " << power[i].mean() << " +- "
          << power[i].error() << ", balance " << balance[i].mean() << " +- " << balance[i].error();
      EXPECT_GT(p_values.back(), level)
          << test.name << ", quarter " << i << ": bdpt " << power[i].mean() << " +- "
          << power[i].error() << ", path " << path[i].mean() << " +- " << path[i].error();
    }
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
}

/// Moments of image means over runs of their own.
template <class Render>
Moments means_over_runs(const Render& render_with) {
  Moments result;
  for (std::uint64_t run = 0; run < 16; ++run) {
    RenderOptions render;
    render.seed = run;
    result.add(mean(render_with(render).image));
  }
  return result;
}

/// Path tracing, light tracing and bidirectional path tracing of the scene have equal means, known
/// to a relative error of 1.5 %.
void expect_equal_means(const Scene& scene, int max_depth, int light_samples) {
  const Moments path = means_over_runs([&](RenderOptions& render) {
    render.seed += 100;
    return render_path(scene, {max_depth}, render, 100);
  });
  const auto expect_equal = [&](const char* name, const Moments& other) {
    EXPECT_GT(welch_p_value(path, other), 0.005)
        << "path " << path.mean() << " +- " << path.error() << ", " << name << " " << other.mean()
        << " +- " << other.error();
    EXPECT_LT(std::hypot(path.error(), other.error()), 0.015 * path.mean()) << name;
  };
  expect_equal("light", means_over_runs([&](const RenderOptions& render) {
                 return render_light(scene, {max_depth}, render, light_samples);
               }));
  expect_equal("bdpt", means_over_runs([&](const RenderOptions& render) {
                 return render_bdpt(scene, {.max_depth = max_depth}, render, 40);
               }));
}

// Law: light that comes through one interface, with interpolated normals, into the medium where the
// sensor is has the same radiance from both ends: it is not symmetric under refraction.
TEST(LightTracing, SeesLightThroughWater) {
  SceneBuilder builder;
  const auto material = [&](Bsdf bsdf) {
    return builder.add_material({builder.add_bsdf(std::move(bsdf)), std::nullopt});
  };
  builder.add_shape(quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}), material(Diffuse{}));
  // Water from here down: its normal points up, out of it.
  builder.add_shape(quad({-2, 2, 2}, {4, 0, 0}, {0, 0, -4}, false, 0.25),
                    material(Dielectric{1.33, Texture(Rgbd{1, 1, 1}), Texture(Rgbd{1, 1, 1})}));
  builder.add_shape(quad({-1.5, 3, -1.5}, {3, 0, 0}, {0, 0, 3}), material(Diffuse{}), Rgbd::Ones());
  builder.set_camera(look_at({0, 1.5, 0.01}, {0, 0, 0}, 0.6));
  expect_equal_means(builder.build(), 4, 100);
}

// Law: shading normals far from the geometric ones scatter as much from both ends.
TEST(LightTracing, HasTheShadingNormalsOfPathTracing) {
  SceneBuilder builder;
  const auto material = [&](Bsdf bsdf) {
    return builder.add_material({builder.add_bsdf(std::move(bsdf)), std::nullopt});
  };
  const auto white = material(Diffuse{Texture(Rgbd::Constant(0.9))});
  const auto rough = material(RoughConductor{{Distribution::Ggx, 0.5}});
  const double bend = 0.8;
  builder.add_shape(quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, false, bend), white);
  builder.add_shape(quad({-1, 0, -1}, {2, 0, 0}, {0, 2, 0}, false, bend), white);
  builder.add_shape(quad({-1, 0, 1}, {0, 0, -2}, {0, 2, 0}, false, bend), rough);
  builder.add_shape(quad({1, 0, -1}, {0, 0, 2}, {0, 2, 0}, false, bend), white);
  builder.add_shape(quad({-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, false, bend), white, Rgbd::Ones());
  builder.set_camera(look_at({0, 1, 2.5}, {0, 0.7, 0}, 0.5));
  expect_equal_means(builder.build(), 6, 300);
}

// Law: paths from the light, and no others, find light that comes from a point through smooth glass
// onto a diffuse floor.
TEST(Bdpt, FindsTheCausticOfAPoint) {
  const LoadedScene loaded = load_small("point_caustic");
  const int max_depth = loaded.max_depth.value();
  Moments path, bdpt;
  for (std::uint64_t run = 0; run < 12; ++run) {
    RenderOptions render;
    render.seed = run;
    path.add(mean(render_path(loaded.scene, {max_depth}, render, 16).image));
    bdpt.add(mean(render_bdpt(loaded.scene, {.max_depth = max_depth}, render, 16).image));
  }
  EXPECT_GT(bdpt.mean(), 1.03 * path.mean());
  EXPECT_LT(welch_p_value(bdpt, path), 1e-3);
}

// Law: the sensor's clip planes cut connections to it as they cut its rays.
TEST(LightTracing, ClipPlanesCutConnections) {
  const auto rendered = [](double near_clip, double far_clip) {
    SceneBuilder builder;
    const auto white = builder.add_bsdf(Diffuse{Texture(Rgbd::Constant(0.5))});
    const auto material = builder.add_material({white, std::nullopt});
    // A wall at depth 4, and a smaller screen before it at depth 2, lit from the sensor's side.
    builder.add_shape(quad({-3, -3, -4}, {6, 0, 0}, {0, 6, 0}), material);
    builder.add_shape(quad({-1, -1, -2}, {2, 0, 0}, {0, 2, 0}), material);
    builder.add_emitter(PointEmitter{{0.3, 0.2, 1.0}, Rgbd::Constant(10.0)});
    Camera camera = look_at({0, 0, 0}, {0, 0, -1}, 0.3);
    camera.near_clip = near_clip;
    camera.far_clip = far_clip;
    builder.set_camera(camera);
    const Scene scene = builder.build();
    const double light = mean(render_light(scene, {2}, RenderOptions{}, 1000).image);
    const double path = mean(render_path(scene, {2}, RenderOptions{}, 16).image);
    EXPECT_NEAR(light, path, 0.03 * path + 1e-12) << near_clip << " .. " << far_clip;
    return light;
  };
  const double screen = rendered(0.0, 100.0);
  EXPECT_GT(screen, 0.0);
  // Behind the screen the wall lies in its shadow.
  EXPECT_EQ(rendered(2.5, 100.0), 0.0);
  EXPECT_EQ(rendered(0.0, 1.5), 0.0);
  EXPECT_NEAR(rendered(1.5, 2.5), screen, 0.03 * screen);
}

TEST(Bdpt, OptionsHaveTextAndBounds) {
  BdptOptions bdpt;
  const auto list = entries(bdpt);
  set_option(list, "heuristic", "balance");
  EXPECT_EQ(bdpt.heuristic, MisHeuristic::Balance);
  set_option(list, "heuristic", "power");
  EXPECT_EQ(bdpt.heuristic, MisHeuristic::Power);
  set_option(list, "max_depth", "3");
  EXPECT_EQ(bdpt.max_depth, 3);
  EXPECT_THROW(set_option(list, "heuristic", "maximum"), OptionError);
  LightOptions light;
  set_option(entries(light), "max_depth", "4");
  EXPECT_EQ(light.max_depth, 4);
  EXPECT_THROW(set_option(entries(light), "heuristic", "power"), OptionError);

  EXPECT_NO_THROW(BdptOptions().validate());
  EXPECT_NO_THROW(LightOptions().validate());
  const Scene scene = furnace(0.5);
  EXPECT_THROW(render_bdpt(scene, {.max_depth = 17}, RenderOptions{}, 1), OptionError);
  EXPECT_THROW(render_light(scene, {.max_depth = 0}, RenderOptions{}, 1), OptionError);
}

// Law: the shortest depth shows emitters alone, without noise, as does every integrator.
TEST(Bdpt, ShortestPathsAreHits) {
  const Scene scene = furnace(0.5);
  EXPECT_NEAR(mean(render_bdpt(scene, {.max_depth = 1}, RenderOptions{}, 1).image), 1.0, 1e-6);
}

}  // namespace
}  // namespace driftlight::test
