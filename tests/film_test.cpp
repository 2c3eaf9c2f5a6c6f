// SPDX-License-Identifier: Apache-2.0
/// Laws of the film: sums are exact, so that neither order nor threads show.
#include "driftlight/film.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <thread>
#include <vector>

#include "driftlight/random.h"

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

}  // namespace
}  // namespace driftlight::test
