// SPDX-License-Identifier: Apache-2.0
/// Laws of the film: sums are exact, so that neither order nor threads show, and
/// filters spread them over the pixels.
#include "driftlight/film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "driftlight/random.h"
#include "driftlight/render.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

struct Splat {
  Vec2d film;
  Rgbd color;
  double weight;
};

/// Splats of unit luminance crowded onto a few pixels.
std::vector<Splat> random_splats(int count) {
  Rng rng(151, Stream::Test, 0);
  std::vector<Splat> result;
  for (int i = 0; i < count; ++i) {
    Splat splat;
    splat.film = rng.uniform2().cwiseAbs2();
    splat.color = Rgbd(rng.uniform3().array());
    splat.color /= luminance(splat.color);
    splat.weight = rng.uniform();
    result.push_back(splat);
  }
  return result;
}

Image image_of(const std::vector<Splat>& splats) {
  Film film(7, 5);
  for (const Splat& s : splats) film.splat(s.film, s.color, s.weight);
  return film.develop(0.37);
}

bool same_bits(const Image& a, const Image& b) {
  return a.rgb.size() == b.rgb.size() &&
         std::memcmp(a.rgb.data(), b.rgb.data(), a.rgb.size() * sizeof(float)) == 0;
}

// Law: the same splats in any order give the same bits.
TEST(Film, OrderDoesNotShow) {
  std::vector<Splat> splats = random_splats(20000);
  const Image expected = image_of(splats);
  std::reverse(splats.begin(), splats.end());
  EXPECT_TRUE(same_bits(image_of(splats), expected));
  std::sort(splats.begin(), splats.end(),
            [](const Splat& a, const Splat& b) { return a.weight < b.weight; });
  EXPECT_TRUE(same_bits(image_of(splats), expected));
  // The test can tell: one splat less is seen.
  splats.pop_back();
  EXPECT_FALSE(same_bits(image_of(splats), expected));
}

// Law: the same splats from several threads give the same bits.
TEST(Film, ThreadsDoNotShow) {
  const std::vector<Splat> splats = random_splats(20000);
  const Image expected = image_of(splats);
  for (const std::size_t threads : {2U, 4U}) {
    Film film(7, 5);
    std::vector<std::thread> workers;
    for (std::size_t worker = 0; worker < threads; ++worker)
      workers.emplace_back([&, worker] {
        for (std::size_t i = worker; i < splats.size(); i += threads)
          film.splat(splats[i].film, splats[i].color, splats[i].weight);
      });
    for (std::thread& worker : workers) worker.join();
    EXPECT_TRUE(same_bits(film.develop(0.37), expected)) << threads;
  }
}

// Law: a splat lands in its pixel, with its weight, and nowhere else; the edges belong to the film.
TEST(Film, SplatsLandInTheirPixel) {
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      Film film(7, 5);
      film.splat({(x + 0.5) / 7.0, (y + 0.5) / 5.0}, {0.5, 1.0, 2.0}, 0.25);
      const Image image = film.develop(4.0);
      for (int j = 0; j < 5; ++j) {
        for (int i = 0; i < 7; ++i) {
          const float on = i == x && j == y ? 1.0F : 0.0F;
          EXPECT_NEAR(image.pixel(i, j)[0], 0.5F * on, 1e-7F);
          EXPECT_NEAR(image.pixel(i, j)[1], 1.0F * on, 1e-7F);
          EXPECT_NEAR(image.pixel(i, j)[2], 2.0F * on, 1e-7F);
        }
      }
    }
  }
  Film film(7, 5);
  film.splat({0.0, 0.0}, {1, 1, 1}, 1.0);
  film.splat({1.0, 1.0}, {1, 1, 1}, 1.0);
  const Image image = film.develop(1.0);
  EXPECT_EQ(image.pixel(0, 0)[0], 1.0F);
  EXPECT_EQ(image.pixel(6, 4)[0], 1.0F);
}

// Law: a million splats lose nothing: the sum is exact to the unit of each.
TEST(Film, SumsAreExact) {
  Film film(1, 1);
  const int count = 1000000;
  for (int i = 0; i < count; ++i) film.splat({0.5, 0.5}, {1.0, 0.5, 0.1}, 1e-3);
  const Image image = film.develop(1.0);
  EXPECT_NEAR(image.pixel(0, 0)[0], 1000.0, 1e-3);
  EXPECT_NEAR(image.pixel(0, 0)[1], 500.0, 1e-3);
  EXPECT_NEAR(image.pixel(0, 0)[2], 100.0, 1e-3);
}

using Kind = ReconstructionFilter::Kind;

std::vector<ReconstructionFilter> filters() {
  return {{Kind::Box, 0.5},
          {Kind::Box, 1.3},
          {Kind::Tent, 1.0},
          {Kind::Gaussian, 2.0, 0.5},
          {Kind::Gaussian, 1.2, 0.3},
          {Kind::Cubic, 2.0},
          {Kind::Cubic, 2.0, 0.5, 0.0, 0.5},
          {Kind::Lanczos, 3.0}};
}

/// int f, by the midpoint rule.
template <class F>
double integral(double from, double to, const F& f) {
  constexpr int kSteps = 20000;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) sum += f(from + (to - from) * (i + 0.5) / kSteps);
  return sum * (to - from) / kSteps;
}

// Law: integrals of filters are what the midpoint rule says; whole ones of a tent its radius, of a
// cubic spline 1, of a Gaussian sigma sqrt(2 pi) less what is cut off.
TEST(ReconstructionFilter, Integrals) {
  for (const ReconstructionFilter& h : filters()) {
    for (const double from : {-h.radius, -0.5, 0.2})
      EXPECT_NEAR(h.integral(from, 9.0), integral(from, h.radius, h), 2e-4);
    EXPECT_EQ(h.integral(h.radius, 20.0), 0.0);
  }
  EXPECT_NEAR(ReconstructionFilter({Kind::Tent, 1.5}).integral(-9, 9), 1.5, 1e-12);
  EXPECT_NEAR(ReconstructionFilter({Kind::Cubic, 2.0}).integral(-9, 9), 1.0, 1e-12);
  const double cut = 4.0 * std::exp(-8.0) + std::sqrt(2.0 * kPi) * 0.5 * std::erfc(std::sqrt(8.0));
  EXPECT_NEAR(ReconstructionFilter({Kind::Gaussian, 2.0, 0.5}).integral(-9, 9),
              0.5 * std::sqrt(2.0 * kPi) - cut, 1e-7);
}

// Law: cubics and Lanczos are negative somewhere, Catmull-Rom and Lanczos interpolate (0 at other
// pixels), and all are even.
TEST(ReconstructionFilter, Shapes) {
  const ReconstructionFilter catmull_rom{Kind::Cubic, 2.0, 0.5, 0.0, 0.5};
  const ReconstructionFilter lanczos{Kind::Lanczos, 3.0};
  for (const ReconstructionFilter& h : {catmull_rom, lanczos}) {
    EXPECT_NEAR(h(0.0), 1.0, 1e-12);
    EXPECT_NEAR(h(1.0), 0.0, 1e-12);
    EXPECT_LT(h(1.5), -0.03);
  }
  EXPECT_NEAR(ReconstructionFilter({Kind::Cubic, 2.0})(0.0), 8.0 / 9.0, 1e-12);  // (6 - 2 B) / 6
  for (const ReconstructionFilter& h : filters()) EXPECT_EQ(h(0.3), h(-0.3));
}

// Law: splats spread evenly over the film make an even image, at the edges too, whatever the
// filter; and a single one is seen in each pixel by its weight there, also a negative one.
TEST(Film, FiltersKeepAnEvenImageEven) {
  for (const ReconstructionFilter& h : filters()) {
    Film film(7, 5, h);
    constexpr int kPerPixel = 40;
    for (int y = 0; y < 5 * kPerPixel; ++y)
      for (int x = 0; x < 7 * kPerPixel; ++x)
        film.splat({(x + 0.5) / (7 * kPerPixel), (y + 0.5) / (5 * kPerPixel)}, {1, 0.5, 2}, 0.5);
    const Image image = film.develop(1.0 / (kPerPixel * kPerPixel));
    for (int y = 0; y < 5; ++y)
      for (int x = 0; x < 7; ++x) EXPECT_NEAR(image.pixel(x, y)[0], 0.5, 0.02);
  }
  Film film(9, 9, {Kind::Lanczos, 3.0});
  film.splat({5.0 / 9.0, 4.5 / 9.0}, {1, 1, 1}, 1.0);
  const Image image = film.develop(1.0);
  const ReconstructionFilter lanczos{Kind::Lanczos, 3.0};
  for (const int x : {3, 4, 5, 6}) {
    const double whole = lanczos.integral(-x - 0.5, 8.5 - x) * lanczos.integral(-4.5, 4.5);
    EXPECT_NEAR(static_cast<double>(image.pixel(x, 4)[0]), lanczos(4.5 - x) / whole, 1e-6);
  }
  EXPECT_LT(image.pixel(6, 4)[0], -0.1F);
}

// Law: every integrator's image is the convolution of radiance with the filter: of an emitter whose
// half of the film is lit, in closed form.
TEST(Film, IntegratorsShareTheFilter) {
  SceneBuilder builder;
  const auto black = builder.add_bsdf(Diffuse{Texture(Rgbd::Zero())});
  builder.add_shape(quad({0, -9, 1}, {0, 18, 0}, {-9, 0, 0}),
                    builder.add_material({black, std::nullopt}), Rgbd::Ones());
  Camera camera = look_at({0, 0, 3}, {0, 0, 0}, 0.5);
  camera.film_width = camera.film_height = 8;
  camera.filter = {Kind::Cubic, 2.0};
  builder.set_camera(camera);
  const Scene scene = builder.build();
  const bool left = camera.film_position(Vec3d(-1, 0, -3), camera.origin).x() < 0.5;
  const auto check = [&](const std::string& name, const Image& image, double tolerance) {
    for (int x = 0; x < 8; ++x) {
      const double lit = left ? camera.filter.integral(-x - 0.5, 3.5 - x)
                              : camera.filter.integral(3.5 - x, 7.5 - x);
      const double expected = lit / camera.filter.integral(-x - 0.5, 7.5 - x);
      double mean = 0;
      for (int y = 0; y < 8; ++y) mean += static_cast<double>(image.pixel(x, y)[0]) / 8.0;
      EXPECT_NEAR(mean, expected, tolerance) << name << ", column " << x;
    }
  };
  RenderOptions render;
  check("path", render_path(scene, {.max_depth = 2}, render, 400).image, 0.01);
  check("bdpt", render_bdpt(scene, {.max_depth = 2}, render, 400).image, 0.01);
  check("light", render_light(scene, {.max_depth = 2}, render, 400).image, 0.01);
  LangevinOptions options;
  options.max_depth = 2;
  options.bootstrap = 20000;
  options.direct = DirectLight::Chain;
  options.mode = Mode::Chain;
  check("chain", render_langevin(scene, options, render, 800).image, 0.06);
  options.mode = Mode::Redistribution;
  check("redistribution", render_langevin(scene, options, render, 4000).image, 0.02);
}

}  // namespace
}  // namespace driftlight::test
