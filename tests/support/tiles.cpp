// SPDX-License-Identifier: Apache-2.0
#include "support/tiles.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/places.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

constexpr int kTile = 8;

}  // namespace

LoadedScene load_small(const std::string& name, const std::map<std::string, std::string>& defines) {
  LoadOptions options;
  options.defines = {{"width", "32"}, {"height", "24"}};
  for (const auto& [define, value] : defines) options.defines[define] = value;
  return load_scene(own_scene(name), options);
}

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

Scene limelight() {
  SceneBuilder builder;
  const auto material = [&](Bsdf bsdf) {
    return builder.add_material({builder.add_bsdf(std::move(bsdf)), std::nullopt});
  };
  const auto white = material(Diffuse{Texture(Rgbd{0.7, 0.6, 0.5})});
  builder.add_shape(quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}), white);
  builder.add_shape(quad({-2, 0, -1.5}, {4, 0, 0}, {0, 3, 0}), white);
  const Microfacets rough{Distribution::Ggx, 0.4};
  builder.add_shape(
      round_mesh({-0.5, 0.6, 0.2}, 0.5, 8),
      material(RoughConductor{rough, {0.2, 0.9, 1.1}, {3.9, 2.4, 2.2}, Texture(Rgbd{1, 1, 1})}));
  builder.add_shape(round_mesh({0.6, 0.5, 0.0}, 0.45, 5), white);
  builder.add_emitter(SpotEmitter({1.5, 2.5, 1.0}, {-1.6, -2.1, -0.9}, {20, 18, 15}, 0.6, 0.1));
  builder.add_emitter(DirectionalEmitter{Vec3d(0.6, -1.0, -0.7).normalized(), {0.5, 0.8, 1.0}});
  Camera camera = look_at({0.2, 1.6, 3.0}, {0, 0.6, 0}, 0.5);
  camera.half_height = 0.375;
  camera.film_width = 32;
  camera.film_height = 24;
  builder.set_camera(camera);
  return builder.build();
}

void expect_equal_tiles(const std::string& name, const std::vector<Moments>& tiles,
                        const std::vector<Moments>& reference, double resolution) {
  ASSERT_EQ(tiles.size(), reference.size());
  const double level = sidak(0.01, static_cast<int>(tiles.size()));
  std::vector<double> errors;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    errors.push_back(std::hypot(tiles[i].error(), reference[i].error()) / reference[i].mean());
    EXPECT_GT(welch_p_value(tiles[i], reference[i]), level)
        << name << ", tile " << i << ": " << tiles[i].mean() << " +- " << tiles[i].error()
        << ", reference " << reference[i].mean() << " +- " << reference[i].error();
  }
  std::sort(errors.begin(), errors.end());
  const double median = errors[errors.size() / 2];
  EXPECT_LT(median, resolution) << name;
  testing::Test::RecordProperty("error_" + name, std::to_string(median));
}

}  // namespace driftlight::test
