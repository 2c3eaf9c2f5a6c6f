// SPDX-License-Identifier: Apache-2.0
#include "brightness_map.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

/// Values above so many times the mean are cut.
constexpr double kCut = 50.0;

/// The mean of the values, cut at kCut times itself.
double cut_mean(const std::vector<FilmValue>& found, double samples) {
  double mean = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 4; ++round) {
    double sum = 0;
    for (const FilmValue& f : found) sum += std::min(f.value, kCut * mean);
    mean = sum / samples;
  }
  return mean;
}

}  // namespace

BrightnessMap::BrightnessMap(const std::vector<FilmValue>& found, double samples)
    : cells_(kCells * kCells, 1.0) {
  const double mean = cut_mean(found, samples);
  if (!(mean > 0.0)) return;
  std::fill(cells_.begin(), cells_.end(), 0.0);
  const double share = kCells * kCells / samples;
  for (const FilmValue& f : found) {
    const int x = std::clamp(static_cast<int>(f.film.x() * kCells), 0, kCells - 1);
    const int y = std::clamp(static_cast<int>(f.film.y() * kCells), 0, kCells - 1);
    cell(x, y) += share * std::min(f.value, kCut * mean);
  }
  const BrightnessMap sharp = *this;
  const auto at = [&](int x, int y) {
    return sharp.cell(std::clamp(x, 0, kCells - 1), std::clamp(y, 0, kCells - 1));
  };
  const auto row = [&](int x, int y) {
    return 0.25 * at(x - 1, y) + 0.5 * at(x, y) + 0.25 * at(x + 1, y);
  };
  for (int y = 0; y < kCells; ++y)
    for (int x = 0; x < kCells; ++x)
      cell(x, y) =
          0.1 * mean + 0.9 * (0.25 * row(x, y - 1) + 0.5 * row(x, y) + 0.25 * row(x, y + 1));
}

double BrightnessMap::operator()(const Vec2d& film) const {
  const double x = std::clamp(film.x() * kCells - 0.5, 0.0, kCells - 1.0);
  const double y = std::clamp(film.y() * kCells - 0.5, 0.0, kCells - 1.0);
  const int x0 = std::min(static_cast<int>(x), kCells - 2);
  const int y0 = std::min(static_cast<int>(y), kCells - 2);
  const double u = x - x0;
  const double v = y - y0;
  return (1.0 - v) * ((1.0 - u) * cell(x0, y0) + u * cell(x0 + 1, y0)) +
         v * ((1.0 - u) * cell(x0, y0 + 1) + u * cell(x0 + 1, y0 + 1));
}

double BrightnessMap::max() const { return *std::max_element(cells_.begin(), cells_.end()); }

}  // namespace driftlight
