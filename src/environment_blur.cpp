// SPDX-License-Identifier: Apache-2.0
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "driftlight/emitter.h"

namespace driftlight {
namespace {

/// Texels for each standard deviation of the blur.
constexpr double kTexels = 1.5;
constexpr int kLeastHeight = 8;

/// Rows of texels by the angle theta of their centres from the pole.
struct Rows {
  explicit Rows(const Bitmap& bitmap) : height(bitmap.height) {}

  double theta(int row) const { return kPi * (row + 0.5) / height; }
  /// Area of a row of the unit sphere, up to a common factor.
  double area(int row) const { return std::sin(theta(row)); }
  /// The row that holds the angle.
  int at(double angle) const {
    return std::clamp(static_cast<int>(std::floor(angle * kInvPi * height)), 0, height - 1);
  }

  int height;
};

/// Cosines and sines of the angles phi of the columns.
struct Columns {
  explicit Columns(const Bitmap& bitmap) : width(bitmap.width), per_column(2.0 * kPi / width) {
    for (int x = 0; x < width; ++x) {
      cosine.push_back(std::cos(phi(x)));
      sine.push_back(std::sin(phi(x)));
    }
  }

  double phi(int column) const { return (column + 0.5) * per_column; }

  int width;
  double per_column;
  std::vector<double> cosine;
  std::vector<double> sine;
};

/// The map blurred at a texel of another grid.
class Blur {
 public:
  Blur(const Bitmap& from, const Bitmap& to, double sigma)
      : from_(from),
        rows_(from),
        columns_(from),
        to_rows_(to),
        to_columns_(to),
        inverse_(1.0 / (5.0 * sigma * sigma)),
        least_(1.0 - 5.0 * sigma * sigma),
        reach_(least_ > -1.0 ? std::acos(least_) : kPi) {}

  Eigen::Array3f operator()(int column, int row) const {
    const double theta = to_rows_.theta(row);
    Rgbd sum = Rgbd::Zero();
    double weights = 0.0;
    for (int y = rows_.at(theta - reach_); y <= rows_.at(theta + reach_); ++y) {
      // cos gamma = along + across cos(delta phi)
      const double along = std::cos(theta) * std::cos(rows_.theta(y));
      const double across = std::sin(theta) * std::sin(rows_.theta(y));
      const double least = (least_ - along) / across;
      if (least >= 1.0) continue;
      const double widest = least > -1.0 ? std::acos(least) : kPi;
      const auto u = static_cast<std::size_t>(column);
      const double across_cosine = across * to_columns_.cosine[u];
      const double across_sine = across * to_columns_.sine[u];
      const double area = rows_.area(y);
      const double phi = to_columns_.phi(column);
      const int first =
          static_cast<int>(std::floor((phi - widest) / columns_.per_column - 0.5)) + columns_.width;
      const int count = std::min(
          static_cast<int>(std::ceil(2.0 * widest / columns_.per_column)) + 2, columns_.width);
      for (int i = first; i < first + count; ++i) {
        const int x = i % columns_.width;
        const auto v = static_cast<std::size_t>(x);
        const double cosine =
            along + across_cosine * columns_.cosine[v] + across_sine * columns_.sine[v];
        const double t = 1.0 - (1.0 - cosine) * inverse_;
        if (t <= 0.0) continue;
        const double w = area * t * t * t;
        sum += w * from_.at(x, y).cast<double>();
        weights += w;
      }
    }
    return (sum / weights).cast<float>();
  }

 private:
  const Bitmap& from_;
  Rows rows_;
  Columns columns_;
  Rows to_rows_;
  Columns to_columns_;
  double inverse_;  ///< 1 / (5 sigma^2)
  double least_;    ///< cos gamma where the kernel ends
  double reach_;    ///< gamma there
};

}  // namespace

double EnvironmentMap::peak_solid_angle() const {
  const Rows rows(bitmap_);
  double second = 0.0;
  double third = 0.0;
  for (int y = 0; y < bitmap_.height; ++y) {
    for (int x = 0; x < bitmap_.width; ++x) {
      const double l = luminance(Rgbd(bitmap_.at(x, y).cast<double>()));
      second += rows.area(y) * l * l;
      third += rows.area(y) * l * l * l;
    }
  }
  const double texel = texel_angle() * 2.0 * kPi / bitmap_.width;
  return texel * second * second * second / (third * third);
}

EnvironmentMap EnvironmentMap::blurred(double sigma) const {
  Bitmap result;
  result.height = std::clamp(static_cast<int>(std::ceil(kPi * kTexels / sigma)),
                             std::min(kLeastHeight, bitmap_.height), bitmap_.height);
  result.width = std::min(2 * result.height, bitmap_.width);
  result.texels.resize(static_cast<std::size_t>(result.width) *
                       static_cast<std::size_t>(result.height));
  const Blur blur(bitmap_, result, sigma);
  tbb::parallel_for(0, result.height, [&](int y) {
    const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(result.width);
    for (int x = 0; x < result.width; ++x)
      result.texels[row + static_cast<std::size_t>(x)] = blur(x, y);
  });
  Eigen::Matrix3d to_world;
  to_world << axis_x_, axis_y_, axis_z_;
  return EnvironmentMap(std::move(result), to_world, scale_);
}

}  // namespace driftlight
