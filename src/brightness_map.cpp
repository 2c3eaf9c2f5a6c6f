// SPDX-License-Identifier: Apache-2.0
#include "brightness_map.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

constexpr int kCells = 16;  ///< on a side
constexpr int kParts = 4;   ///< of a cell, on a side
/// Values above so many times the mean are cut.
constexpr double kCut = 50.0;
/// Least brightness, over the mean.
constexpr double kLeast = 0.1;

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

/// Over the film, in rows.
struct Grid {
  explicit Grid(int with_width)
      : width(with_width),
        values(static_cast<std::size_t>(width) * static_cast<std::size_t>(width), 0.0) {}
  Grid(const std::vector<FilmValue>& found, double samples, double cut, int with_width)
      : Grid(with_width) {
    const double share = width * width / samples;
    for (const FilmValue& f : found)
      at(static_cast<int>(f.film.x() * width), static_cast<int>(f.film.y() * width)) +=
          share * std::min(f.value, cut);
  }

  /// The nearest, beside the film.
  double& at(int x, int y) { return values[index(x, y)]; }
  double at(int x, int y) const { return values[index(x, y)]; }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(std::clamp(y, 0, width - 1)) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(std::clamp(x, 0, width - 1));
  }

  int width;
  std::vector<double> values;
};

/// Each value with its neighbours, by the weights 1, 2, 1 in rows and columns.
Grid smooth(const Grid& sharp) {
  const auto row = [&](int x, int y) {
    return 0.25 * sharp.at(x - 1, y) + 0.5 * sharp.at(x, y) + 0.25 * sharp.at(x + 1, y);
  };
  Grid result(sharp.width);
  for (int y = 0; y < sharp.width; ++y)
    for (int x = 0; x < sharp.width; ++x)
      result.at(x, y) = 0.25 * row(x, y - 1) + 0.5 * row(x, y) + 0.25 * row(x, y + 1);
  return result;
}

/// sqrt(sum b / sum 1 / b) over the parts of a cell.
double middle(const Grid& parts, double least, int x, int y) {
  double sum = 0.0;
  double inverse_sum = 0.0;
  for (int j = 0; j < kParts; ++j) {
    for (int i = 0; i < kParts; ++i) {
      const double b = least + (1.0 - kLeast) * parts.at(kParts * x + i, kParts * y + j);
      sum += b;
      inverse_sum += 1.0 / b;
    }
  }
  return std::sqrt(sum / inverse_sum);
}

}  // namespace

BrightnessMap::BrightnessMap(const std::vector<FilmValue>& found, double samples)
    : cells_(kCells * kCells, 1.0) {
  const double mean = cut_mean(found, samples);
  if (!(mean > 0.0)) return;
  dark_ = false;
  cells_ = smooth(Grid(found, samples, kCut * mean, kCells)).values;
  for (double& cell : cells_) cell = kLeast * mean + (1.0 - kLeast) * cell;
}

void BrightnessMap::add(const std::vector<FilmValue>& found, double samples) {
  double mean = 0.0;
  for (const FilmValue& f : found) mean += f.value / samples;
  if (!(mean > 0.0)) return;
  const Grid parts(found, samples, std::numeric_limits<double>::infinity(), kParts * kCells);
  Grid sharp(kCells);
  for (int y = 0; y < kCells; ++y)
    for (int x = 0; x < kCells; ++x) sharp.at(x, y) = middle(parts, kLeast * mean, x, y);
  const Grid more = smooth(sharp);
  for (std::size_t i = 0; i < cells_.size(); ++i)
    cells_[i] = (dark_ ? 0.0 : cells_[i]) + more.values[i];
  dark_ = false;
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

double BrightnessMap::cell(int x, int y) const {
  return cells_[static_cast<std::size_t>(y) * kCells + static_cast<std::size_t>(x)];
}

double BrightnessMap::film_unit() const {
  return 64.0 * *std::max_element(cells_.begin(), cells_.end());
}

}  // namespace driftlight
