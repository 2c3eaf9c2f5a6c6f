// SPDX-License-Identifier: Apache-2.0
/// Laws of the figures of independent runs, on runs whose figures are known.
#include "run_figures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "driftlight/random.h"
#include "student.h"

namespace driftlight {
namespace {

/// Standard normal numbers.
class Normal {
 public:
  explicit Normal(std::uint64_t seed) : rng_(seed, Stream::Test, 0) {}
  double operator()() {
    const double radius = std::sqrt(-2.0 * std::log1p(-rng_.uniform()));
    return radius * std::cos(2.0 * 3.14159265358979323846 * rng_.uniform());
  }

 private:
  Rng rng_;
};

Image noise(int width, int height, double mean, double deviation, Normal& normal) {
  Image image(width, height);
  for (float& x : image.rgb) x = static_cast<float>(mean + deviation * normal());
  return image;
}

TEST(Student, KnowsItsTables) {
  Moments numbers;
  for (const double x : {1.0, 2.0, 3.0, 4.0, 5.0}) numbers.add(x);
  EXPECT_DOUBLE_EQ(numbers.variance(), 2.5);
  EXPECT_NEAR(student_half_width(numbers, 0.95), 2.7764451 * std::sqrt(0.5), 1e-6);
  EXPECT_NEAR(student_half_width(numbers, 0.99), 4.6040949 * std::sqrt(0.5), 1e-6);
  // The ends of the interval are where the test is undecided.
  EXPECT_NEAR(student_p_value(numbers, 3.0 + student_half_width(numbers, 0.95)), 0.05, 1e-9);
  EXPECT_EQ(student_p_value(numbers, 3.0), 1.0);
}

TEST(TileLuminances, CoverTheWholeImage) {
  Image image(10, 9);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      for (int c = 0; c < 3; ++c)
        image.pixel(x, y)[c] = x < 8 ? (y < 8 ? 1.0F : 2.0F) : (y < 8 ? 3.0F : 4.0F);
  const std::vector<double> tiles = tile_luminances(image);
  ASSERT_EQ(tiles.size(), 4U);
  const std::vector<double> expected{1.0, 3.0, 2.0, 4.0};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(tiles[i], expected[i], 1e-12) << i;
}

// Law: in expectation it is the variance of one image, whatever both have in common.
TEST(Spread, IsTheVarianceOfOneImage) {
  Normal normal(1);
  const Image a = noise(64, 64, 3.0, 0.2, normal);
  const Image b = noise(64, 64, 3.0, 0.2, normal);
  Image expected(64, 64);
  expected.rgb.assign(expected.rgb.size(), 3.0F);
  const Spread s = spread(a, b, expected);
  // 12288 squares of normal numbers: a relative error of sqrt(2 / 12288).
  EXPECT_NEAR(s.mse / 0.04, 1.0, 0.05);
  EXPECT_NEAR(s.relmse / (0.04 / 9.01), 1.0, 0.06);
  EXPECT_LT(s.relmse_trimmed, s.relmse);
  EXPECT_GT(s.relmse_trimmed, 0.98 * s.relmse);
  EXPECT_EQ(spread(a, a, expected).mse, 0.0);
}

// Law: a heavy sample counts by its whole weight.
TEST(Spread, OfOneHeavyPixelIsTrimmed) {
  Image a(64, 64);
  a.rgb.assign(a.rgb.size(), 1.0F);
  Image b = a;
  b.rgb[300] = 101.0F;
  EXPECT_NEAR(spread(a, b, a).relmse, 5000.0 / 1.01 / 12288.0, 1e-5);
  EXPECT_EQ(spread(a, b, a).relmse_trimmed, 0.0);
}

TEST(MedianImage, IgnoresSingleHeavySamples) {
  Image a(2, 1);
  a.rgb = {1, 2, 3, 4, 5, 6};
  Image b = a;
  b.rgb[1] = 1e6F;
  Image c = a;
  c.rgb[4] = 1e6F;
  EXPECT_EQ(median_image({&a, &b, &c}).rgb, a.rgb);
  EXPECT_EQ(median_image({&b}).rgb, b.rgb);
}

std::vector<Moments> tiles_of(int runs, const std::vector<double>& means, double deviation,
                              Normal& normal) {
  std::vector<Moments> tiles(means.size());
  for (int run = 0; run < runs; ++run)
    for (std::size_t i = 0; i < means.size(); ++i) tiles[i].add(means[i] + deviation * normal());
  return tiles;
}

// Law: right images fail in one of a hundred comparisons.
TEST(TileTest, KeepsItsLevel) {
  Normal normal(2);
  const std::vector<double> means(40, 2.0);
  int failed = 0;
  int small_p = 0;
  for (int i = 0; i < 1000; ++i) {
    const TileTest test = test_tiles(tiles_of(5, means, 0.1, normal), means);
    EXPECT_EQ(test.tiles, 40);
    EXPECT_NEAR(test.resolution, 0.1 / std::sqrt(5.0) / 2.0, 0.01);
    EXPECT_EQ(test.rejected > 0, test.p_value < 0.01);
    if (test.rejected > 0) ++failed;
    if (test.p_value < 0.5) ++small_p;
  }
  // Binomial: 10 +- 3.1 and 500 +- 16.
  EXPECT_LT(failed, 23);
  EXPECT_GT(failed, 1);
  EXPECT_NEAR(small_p, 500, 65);
}

TEST(TileTest, SeesOneWrongTile) {
  Normal normal(3);
  std::vector<double> means(40, 2.0);
  const std::vector<double> reference = means;
  means[17] = 3.0;
  const TileTest test = test_tiles(tiles_of(8, means, 0.05, normal), reference);
  EXPECT_EQ(test.rejected, 1);
  EXPECT_LT(test.p_value, 1e-4);
}

TEST(TileTest, TakesRoundingForNoBias) {
  std::vector<Moments> tiles(1);
  for (int i = 0; i < 4; ++i) tiles[0].add(2.0);
  EXPECT_EQ(test_tiles(tiles, {2.0}).p_value, 1.0);
  EXPECT_GT(test_tiles(tiles, {2.0001}).p_value, 0.1);
  EXPECT_LT(test_tiles(tiles, {2.1}).p_value, 0.01);
}

using Batches = std::vector<std::vector<std::vector<double>>>;

/// 4 runs of 8 parts of 100 tiles; mean(run, part) of each tile.
template <class Mean>
Batches batches_of(const Mean& mean) {
  Normal normal(4);
  Batches batches(4, std::vector<std::vector<double>>(8, std::vector<double>(100)));
  for (std::size_t run = 0; run < 4; ++run)
    for (std::size_t part = 0; part < 8; ++part)
      for (double& x : batches[run][part]) x = mean(run, part) + 0.1 * normal();
  return batches;
}

TEST(Agreement, IsOneOfIndependentParts) {
  const Agreement same = agreement(batches_of([](std::size_t, std::size_t) { return 2.0; }));
  EXPECT_NEAR(same.rhat, 1.0, 0.03);
  EXPECT_GT(same.worst, same.rhat);
  EXPECT_LT(same.worst, 2.0);
}

// Law: with a variance s^2 of the means of halves beside that of the parts, sigma^2, and n = 4,
// R^2 = 3 / 4 + (s^2 + sigma^2 / 4) / sigma^2.
TEST(Agreement, SeesRunsThatDifferAndRunsThatDrift) {
  const Agreement apart = agreement(batches_of(
      [](std::size_t run, std::size_t) { return 2.0 + 0.1 * static_cast<double>(run); }));
  // Variance between eight halves of four values 0.1 apart, each twice: 0.0125 * 8 / 7.
  EXPECT_NEAR(apart.rhat, std::sqrt(1.0 + 0.0125 * 8 / 7 / 0.01), 0.05);
  const Agreement drift =
      agreement(batches_of([](std::size_t, std::size_t part) { return part < 4 ? 1.9 : 2.1; }));
  EXPECT_NEAR(drift.rhat, std::sqrt(1.0 + 0.01 * 8 / 7 / 0.01), 0.05);
}

TEST(Agreement, OfWhatDoesNotVaryIsOne) {
  const Batches constant(2, std::vector<std::vector<double>>(4, std::vector<double>(3, 1.5)));
  EXPECT_EQ(agreement(constant).rhat, 1.0);
  EXPECT_EQ(agreement(constant).worst, 1.0);
}

// Law: the mean of n samples with a relative variance of one has a relative variance of 1 / n.
TEST(EffectiveSamples, CountSamplesOfUnitVariance) {
  Normal normal(5);
  const std::vector<double> means(2000, 3.0);
  const double samples =
      effective_samples(tiles_of(5, means, 3.0 / std::sqrt(400.0), normal), means);
  // Relative to m^2 + 0.01; 8000 degrees of freedom.
  EXPECT_NEAR(samples / (400.0 * 9.01 / 9.0), 1.0, 0.06);
}

TEST(Median, IsTheMiddle) {
  EXPECT_EQ(median({3.0}), 3.0);
  EXPECT_EQ(median({5.0, 1.0, 3.0}), 3.0);
  EXPECT_EQ(median({4.0, 1.0, 3.0, 9.0}), 3.5);
}

}  // namespace
}  // namespace driftlight
