// SPDX-License-Identifier: Apache-2.0
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "driftlight/emitter.h"

namespace driftlight {
namespace {

/// Texels for each standard deviation of the blur.
constexpr double kTexels = 1.5;
constexpr int kLeastHeight = 8;

/// Rows of texels by the angle theta of their centres from the pole.
struct Rows {
  explicit Rows(const Bitmap& bitmap) : height(bitmap.height) {
    const Eigen::ArrayXd thetas =
        (Eigen::ArrayXd::LinSpaced(height, 0.0, height - 1.0) + 0.5) * (kPi / height);
    cosine = thetas.cos();
    sine = thetas.sin();
  }

  double theta(int row) const { return kPi * (row + 0.5) / height; }
  /// Area of a row of the unit sphere, up to a common factor.
  double area(int row) const { return sine[row]; }
  /// The row that holds the angle.
  int at(double angle) const {
    return std::clamp(static_cast<int>(std::floor(angle * kInvPi * height)), 0, height - 1);
  }

  int height;
  Eigen::ArrayXd cosine;
  Eigen::ArrayXd sine;
};

/// Cosines and sines of the angles phi of the columns, twice around, so that a stretch of columns
/// need not wrap.
struct Columns {
  explicit Columns(const Bitmap& bitmap) : width(bitmap.width), per_column(2.0 * kPi / width) {
    const Eigen::ArrayXd phis =
        (Eigen::ArrayXd::LinSpaced(2 * width, 0.0, 2.0 * width - 1.0) + 0.5) * per_column;
    cosine = phis.cos();
    sine = phis.sin();
  }

  double phi(int column) const { return (column + 0.5) * per_column; }

  int width;
  double per_column;
  Eigen::ArrayXd cosine;
  Eigen::ArrayXd sine;
};

/// One channel of a bitmap, its columns likewise twice.
using Plane = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::array<Plane, 3> planes_of(const Bitmap& bitmap) {
  std::array<Plane, 3> planes;
  for (Plane& plane : planes) plane.resize(bitmap.height, 2 * bitmap.width);
  for (int y = 0; y < bitmap.height; ++y)
    for (int x = 0; x < bitmap.width; ++x)
      for (int c = 0; c < 3; ++c)
        planes[static_cast<std::size_t>(c)](y, x) =
            planes[static_cast<std::size_t>(c)](y, x + bitmap.width) = bitmap.at(x, y)[c];
  return planes;
}

/// The map blurred at texels of another grid.
class Blur {
 public:
  Blur(const Bitmap& from, const Bitmap& to, double sigma)
      : planes_(planes_of(from)),
        rows_(from),
        columns_(from),
        to_rows_(to),
        to_columns_(to),
        inverse_(1.0 / (5.0 * sigma * sigma)),
        least_(1.0 - 5.0 * sigma * sigma),
        reach_(least_ > -1.0 ? std::acos(least_) : kPi) {}

  Eigen::Array3f operator()(int column, int row) const {
    const double theta = to_rows_.theta(row);
    const double phi = to_columns_.phi(column);
    Rgbd sum = Rgbd::Zero();
    double weights = 0.0;
    Eigen::ArrayXd w(columns_.width);
    for (int y = rows_.at(theta - reach_); y <= rows_.at(theta + reach_); ++y) {
      // cos gamma = along + across cos(delta phi)
      const double along = to_rows_.cosine[row] * rows_.cosine[y];
      const double across = to_rows_.sine[row] * rows_.sine[y];
      const double least = (least_ - along) / across;
      if (least >= 1.0) continue;
      const double widest = least > -1.0 ? std::acos(least) : kPi;
      const int first = (static_cast<int>(std::floor((phi - widest) / columns_.per_column - 0.5)) +
                         columns_.width) %
                        columns_.width;
      const int count = std::min(
          static_cast<int>(std::ceil(2.0 * widest / columns_.per_column)) + 2, columns_.width);
      w.head(count) =
          (1.0 - inverse_ +
           inverse_ * (along +
                       across * to_columns_.cosine[column] * columns_.cosine.segment(first, count) +
                       across * to_columns_.sine[column] * columns_.sine.segment(first, count)))
              .max(0.0)
              .cube();
      const double area = rows_.area(y);
      weights += area * w.head(count).sum();
      for (int c = 0; c < 3; ++c) {
        const auto stretch = planes_[static_cast<std::size_t>(c)].row(y).segment(first, count);
        sum[c] += area * (w.head(count) * stretch.cast<double>().transpose()).sum();
      }
    }
    return (sum / weights).cast<float>();
  }

 private:
  std::array<Plane, 3> planes_;
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
