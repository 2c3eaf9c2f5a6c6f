// SPDX-License-Identifier: Apache-2.0
#include "run_figures.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <utility>

#include "driftlight/scalar.h"

namespace driftlight {
namespace {

constexpr int kTile = 8;
/// Relative precision of a stored mean.
constexpr double kRounding = 1e-4;
constexpr double kFamilyLevel = 0.01;
/// Added to squares of brightness where something is relative to them.
constexpr double kDark = 0.01;

/// Means and variances over the draws of half a run.
Moments half_of(const std::vector<std::vector<double>>& parts, std::size_t half, std::size_t tile) {
  const std::size_t n = parts.size() / 2;
  Moments draws;
  for (std::size_t i = half * n; i < (half + 1) * n; ++i) draws.add(parts[i][tile]);
  return draws;
}

double rhat(double within, double between, double draws) {
  return std::sqrt((draws - 1.0) / draws + between / within);
}

}  // namespace

std::vector<double> tile_luminances(const Image& image) {
  std::vector<double> means;
  for (int top = 0; top < image.height; top += kTile)
    for (int left = 0; left < image.width; left += kTile) {
      Moments luminances;
      for (int y = top; y < std::min(top + kTile, image.height); ++y)
        for (int x = left; x < std::min(left + kTile, image.width); ++x) {
          const float* p = image.pixel(x, y);
          luminances.add(luminance(Rgbd(static_cast<double>(p[0]), static_cast<double>(p[1]),
                                        static_cast<double>(p[2]))));
        }
      means.push_back(luminances.mean());
    }
  return means;
}

Spread spread(const Image& a, const Image& b, const Image& expected) {
  assert(a.width == b.width && a.height == b.height);
  // An image that is off by as much as the two are from each other.
  Image off = expected;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) off.rgb[i] += a.rgb[i] - b.rgb[i];
  const Difference d = difference(off, expected);
  return {.mse = 0.5 * d.mse, .relmse = 0.5 * d.relmse, .relmse_trimmed = 0.5 * d.relmse_trimmed};
}

Image median_image(const std::vector<const Image*>& images) {
  Image result(images.front()->width, images.front()->height);
  std::vector<float> values(images.size());
  for (std::size_t i = 0; i < result.rgb.size(); ++i) {
    for (std::size_t k = 0; k < images.size(); ++k) values[k] = images[k]->rgb[i];
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    result.rgb[i] = *middle;
  }
  return result;
}

TileTest test_tiles(const std::vector<Moments>& tiles, const std::vector<double>& reference) {
  const int count = static_cast<int>(tiles.size());
  const double level = sidak(kFamilyLevel, count);
  TileTest test{.tiles = count};
  double least = 1.0;
  std::vector<double> resolutions;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const double expected = reference[i];
    const double error = std::hypot(tiles[i].error(), kRounding * expected);
    const double difference = tiles[i].mean() - expected;
    const double p =
        difference == 0.0
            ? 1.0
            : student_two_sided(difference / error, static_cast<double>(tiles[i].count()) - 1.0);
    if (p < level) ++test.rejected;
    least = std::min(least, p);
    if (expected > 0.0) resolutions.push_back(error / expected);
  }
  test.p_value = -std::expm1(static_cast<double>(count) * std::log1p(-least));
  if (!resolutions.empty()) test.resolution = median(std::move(resolutions));
  return test;
}

Agreement agreement(const std::vector<std::vector<std::vector<double>>>& batches) {
  const std::size_t half = batches.front().size() / 2;
  const std::size_t tiles = batches.front().front().size();
  const auto draws = static_cast<double>(half);
  double sum_within = 0;
  double sum_between = 0;
  Agreement result;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    Moments within;
    Moments means;
    for (const auto& run : batches)
      for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) {
        const Moments part = half_of(run, which, tile);
        within.add(part.variance());
        means.add(part.mean());
      }
    const double square = means.mean() * means.mean();
    // What does not vary but for rounding agrees.
    if (!(within.mean() > kRounding * kRounding * square)) continue;
    sum_within += within.mean() / (square + kDark);
    sum_between += means.variance() / (square + kDark);
    result.worst = std::max(result.worst, rhat(within.mean(), means.variance(), draws));
  }
  if (sum_within > 0.0) result.rhat = rhat(sum_within, sum_between, draws);
  return result;
}

double effective_samples(const std::vector<Moments>& tiles, const std::vector<double>& expected) {
  Moments relative;
  for (std::size_t i = 0; i < tiles.size(); ++i)
    relative.add(tiles[i].variance() / (expected[i] * expected[i] + kDark));
  return 1.0 / relative.mean();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

}  // namespace driftlight
