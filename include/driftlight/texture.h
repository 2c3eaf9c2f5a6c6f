// SPDX-License-Identifier: Apache-2.0
/// Textures: a constant colour or a bilinearly filtered bitmap.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "driftlight/scalar.h"

namespace driftlight {

/// Linear sRGB texels, row by row from the top; (u, v) = (0, 0) is the corner of the first texel.
struct Bitmap {
  int width = 0;
  int height = 0;
  std::vector<Eigen::Array3f> texels;

  const Eigen::Array3f& at(int x, int y) const {
    return texels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

enum class Wrap { Repeat, Clamp };

/// The bilinear patch between the four texel centres around pixel coordinates (x, y), where texel
/// (i, j) has its centre at (i + 1/2, j + 1/2):
///   c(x, y) = c00 + fx (c10 - c00) + fy (c01 - c00) + fx fy (c00 - c10 - c01 + c11),
/// fx, fy in [0, 1) from the first centre.
struct BilinearPatch {
  Rgbd c00, c10, c01, c11;
  double x0, y0;  ///< the first texel centre

  BilinearPatch(const Bitmap& bitmap, double x, double y, Wrap wrap_x, Wrap wrap_y) {
    const auto wrap = [](int i, int n, Wrap mode) {
      if (mode == Wrap::Clamp) return std::min(std::max(i, 0), n - 1);
      const int r = i % n;
      return r < 0 ? r + n : r;
    };
    const double left_texel = std::floor(x - 0.5);
    const double top_texel = std::floor(y - 0.5);
    const int left = wrap(static_cast<int>(left_texel), bitmap.width, wrap_x);
    const int right = wrap(static_cast<int>(left_texel) + 1, bitmap.width, wrap_x);
    const int top = wrap(static_cast<int>(top_texel), bitmap.height, wrap_y);
    const int bottom = wrap(static_cast<int>(top_texel) + 1, bitmap.height, wrap_y);
    c00 = bitmap.at(left, top).cast<double>();
    c10 = bitmap.at(right, top).cast<double>();
    c01 = bitmap.at(left, bottom).cast<double>();
    c11 = bitmap.at(right, bottom).cast<double>();
    x0 = left_texel + 0.5;
    y0 = top_texel + 0.5;
  }

  /// d c / dx and d c / dy at (x, y).
  Rgbd slope_x(double y) const { return (c10 - c00) + (y - y0) * (c11 - c01 - (c10 - c00)); }
  Rgbd slope_y(double x) const { return (c01 - c00) + (x - x0) * (c11 - c10 - (c01 - c00)); }
};

/// Bilinear interpolation. The bitmap is an opaque function of doubles; a Jet crosses it by the
/// chain rule, with the exact slopes of the bilinear patch. The derivative jumps between patches.
template <Scalar T>
Rgb<T> lookup(const Bitmap& bitmap, const T& x, const T& y, Wrap wrap_x, Wrap wrap_y) {
  const BilinearPatch patch(bitmap, value(x), value(y), wrap_x, wrap_y);
  const T fx = x - patch.x0;
  const T fy = y - patch.y0;
  Rgb<T> result;
  for (int c = 0; c < 3; ++c) {
    const T upper = fx * (patch.c10[c] - patch.c00[c]) + patch.c00[c];
    const T lower = fx * (patch.c11[c] - patch.c01[c]) + patch.c01[c];
    result[c] = upper + fy * (lower - upper);
  }
  return result;
}

/// A colour over the surface. Without a bitmap it is `color`; with one it is the bitmap, repeated,
/// looked up at uv * uv_scale + uv_offset in units of the whole bitmap.
struct Texture {
  Rgbd color{0.5, 0.5, 0.5};
  std::shared_ptr<const Bitmap> bitmap;
  Vec2d uv_scale{1, 1};
  Vec2d uv_offset{0, 0};
  /// Factor on the bitmap (energy conservation of BSDFs scales their textures).
  double scale = 1;

  Texture() = default;
  explicit Texture(const Rgbd& constant_color) : color(constant_color) {}

  bool is_constant() const { return bitmap == nullptr; }
  /// Derivatives of `eval` by u and by v.
  struct Slopes {
    Rgbd u, v;
  };
  Slopes slopes(const Vec2d& uv) const;

  /// Largest component that the texture takes anywhere.
  double maximum() const;
  /// Mean colour (over the bitmap).
  Rgbd average() const;

  template <Scalar T>
  Rgb<T> eval(const Vec2<T>& uv) const {
    if (is_constant()) return constant<T>(color);
    const T x = (uv.x() * uv_scale.x() + uv_offset.x()) * static_cast<double>(bitmap->width);
    const T y = (uv.y() * uv_scale.y() + uv_offset.y()) * static_cast<double>(bitmap->height);
    Rgb<T> c = lookup(*bitmap, x, y, Wrap::Repeat, Wrap::Repeat);
    for (int i = 0; i < 3; ++i) c[i] = c[i] * scale;
    return c;
  }
};

}  // namespace driftlight
