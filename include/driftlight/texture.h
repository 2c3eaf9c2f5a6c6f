// SPDX-License-Identifier: Apache-2.0
/// Textures: a constant colour, a bitmap or a pattern of two colours.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
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

/// What is beyond the edges of a bitmap: itself, its last texels, its mirror image, black or white.
enum class Wrap { Repeat, Clamp, Mirror, Zero, One };

inline constexpr int kBlackTexel = -1;
inline constexpr int kWhiteTexel = -2;

/// Index of texel i in a row of n, of which it may be beyond the edges; kBlackTexel or kWhiteTexel
/// if nothing of the row is there. In double, as an int has no room for coordinates scaled by a
/// lot.
inline int wrapped_index(double i, int n, Wrap wrap) {
  if (wrap == Wrap::Repeat) i -= n * std::floor(i / n);
  if (wrap == Wrap::Mirror) {
    i -= 2.0 * n * std::floor(i / (2.0 * n));
    i = std::min(i, 2.0 * n - 1.0 - i);
  }
  const bool outside = !(i >= 0.0 && i < n);
  if (outside && wrap == Wrap::Zero) return kBlackTexel;
  if (outside && wrap == Wrap::One) return kWhiteTexel;
  return static_cast<int>(std::min(std::max(0.0, i), n - 1.0));
}

/// The texel at two wrapped indices.
inline Rgbd wrapped_texel(const Bitmap& bitmap, int x, int y) {
  if (x < 0 || y < 0) return Rgbd::Constant((x < 0 ? x : y) == kWhiteTexel ? 1.0 : 0.0);
  return bitmap.at(x, y).cast<double>();
}

/// The bilinear patch between the four texel centres around pixel coordinates (x, y), where texel
/// (i, j) has its centre at (i + 1/2, j + 1/2):
///   c(x, y) = c00 + fx (c10 - c00) + fy (c01 - c00) + fx fy (c00 - c10 - c01 + c11),
/// fx, fy in [0, 1) from the first centre.
struct BilinearPatch {
  Rgbd c00, c10, c01, c11;
  double x0, y0;  ///< the first texel centre

  BilinearPatch(const Bitmap& bitmap, double x, double y, Wrap wrap_x, Wrap wrap_y) {
    const double left_texel = std::floor(x - 0.5);
    const double top_texel = std::floor(y - 0.5);
    const int left = wrapped_index(left_texel, bitmap.width, wrap_x);
    const int right = wrapped_index(left_texel + 1.0, bitmap.width, wrap_x);
    const int top = wrapped_index(top_texel, bitmap.height, wrap_y);
    const int bottom = wrapped_index(top_texel + 1.0, bitmap.height, wrap_y);
    c00 = wrapped_texel(bitmap, left, top);
    c10 = wrapped_texel(bitmap, right, top);
    c01 = wrapped_texel(bitmap, left, bottom);
    c11 = wrapped_texel(bitmap, right, bottom);
    x0 = left_texel + 0.5;
    y0 = top_texel + 0.5;
  }

  /// d^2 c / dx dy, which is constant; the other second derivatives are 0.
  Rgbd mixed() const { return c11 - c01 - (c10 - c00); }
  /// d c / dx and d c / dy at (x, y).
  template <Scalar T>
  Rgb<T> slope_x(const T& y) const {
    return slope<T>(c10 - c00, T(y - y0));
  }
  template <Scalar T>
  Rgb<T> slope_y(const T& x) const {
    return slope<T>(c01 - c00, T(x - x0));
  }

 private:
  template <Scalar T>
  Rgb<T> slope(const Rgbd& at_edge, const T& across) const {
    const Rgbd change = mixed();
    Rgb<T> result;
    for (int c = 0; c < 3; ++c) result[c] = across * change[c] + at_edge[c];
    return result;
  }
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

/// Two colours in a pattern that repeats with period 1 in both coordinates. Constant between its
/// edges, at which it jumps.
struct TwoColors {
  enum class Layout {
    Checkerboard,  ///< four squares: color0 where both coordinates are in the same half
    Grid           ///< lines of color1 around the integers, as wide as `line_width` on either side
  };

  Layout layout = Layout::Checkerboard;
  Rgbd color0{0.4, 0.4, 0.4};
  Rgbd color1{0.2, 0.2, 0.2};
  double line_width = 0;

  const Rgbd& at(const Vec2d& p) const {
    const Vec2d in_period = p.array() - p.array().floor();
    if (layout == Layout::Checkerboard)
      return (in_period.x() < 0.5) == (in_period.y() < 0.5) ? color0 : color1;
    const Vec2d to_line = in_period.array().min(1.0 - in_period.array());
    return to_line.minCoeff() < line_width ? color1 : color0;
  }
  /// The share of color1.
  double share1() const {
    const double between = 1.0 - 2.0 * std::min(line_width, 0.5);
    return layout == Layout::Checkerboard ? 0.5 : 1.0 - between * between;
  }
};

/// A colour over the surface: the bitmap or the pattern if there is one, else `color`. Bitmap and
/// pattern are looked up at uv_to_texture * uv + uv_offset, a bitmap in units of its whole.
struct Texture {
  Rgbd color{0.5, 0.5, 0.5};
  std::shared_ptr<const Bitmap> bitmap;
  std::optional<TwoColors> pattern;
  Eigen::Matrix2d uv_to_texture = Eigen::Matrix2d::Identity();
  Vec2d uv_offset{0, 0};
  Wrap wrap_u = Wrap::Repeat;  ///< of the bitmap
  Wrap wrap_v = Wrap::Repeat;
  bool interpolates = true;  ///< bilinearly between texels; else a texel is a square of its colour
  /// Factor on bitmap or pattern (energy conservation of BSDFs scales their textures).
  Rgbd scale{1, 1, 1};

  Texture() = default;
  explicit Texture(const Rgbd& constant_color) : color(constant_color) {}

  bool is_constant() const { return bitmap == nullptr && !pattern; }
  /// Derivatives of `eval` by u and by v.
  template <Scalar T>
  struct SlopesOf {
    Rgb<T> u, v;
  };
  using Slopes = SlopesOf<double>;
  /// The second ones.
  struct Curvatures {
    Rgbd uu, uv, vv;
  };
  Curvatures curvatures(const Vec2d& uv) const;

  /// Largest value of each component that the texture takes anywhere.
  Rgbd maximum_color() const;
  double maximum() const { return maximum_color().maxCoeff(); }
  /// Mean colour (over bitmap or pattern).
  Rgbd average() const;

  template <Scalar T>
  Rgb<T> eval(const Vec2<T>& uv) const {
    if (is_constant()) return constant<T>(color);
    // Patterns and single texels are constant but for jumps.
    if (pattern || !interpolates) return constant<T>(steps({value(uv.x()), value(uv.y())}));
    const Vec2<T> p = texel_place(uv);
    Rgb<T> c = lookup(*bitmap, p.x(), p.y(), wrap_u, wrap_v);
    for (int i = 0; i < 3; ++i) c[i] = c[i] * scale[i];
    return c;
  }

  template <Scalar T>
  SlopesOf<T> slopes(const Vec2<T>& uv) const {
    if (!is_smooth()) return {constant<T>(Rgbd(0, 0, 0)), constant<T>(Rgbd(0, 0, 0))};
    const Vec2<T> p = texel_place(uv);
    const BilinearPatch patch(*bitmap, value(p.x()), value(p.y()), wrap_u, wrap_v);
    const Rgb<T> slope_x = patch.slope_x(p.y());
    const Rgb<T> slope_y = patch.slope_y(p.x());
    const Eigen::Matrix2d m = uv_to_texels();
    SlopesOf<T> result;
    for (int i = 0; i < 3; ++i) {
      result.u[i] = (slope_x[i] * m(0, 0) + slope_y[i] * m(1, 0)) * scale[i];
      result.v[i] = (slope_x[i] * m(0, 1) + slope_y[i] * m(1, 1)) * scale[i];
    }
    return result;
  }

 private:
  /// True if it has derivatives other than 0.
  bool is_smooth() const { return bitmap != nullptr && !pattern && interpolates; }
  /// Coordinates in texels of the bitmap.
  template <Scalar T>
  Vec2<T> texel_place(const Vec2<T>& uv) const {
    const double width = bitmap->width;
    const double height = bitmap->height;
    const Eigen::Matrix2d& m = uv_to_texture;
    return {(uv.x() * m(0, 0) + uv.y() * m(0, 1) + uv_offset.x()) * width,
            (uv.x() * m(1, 0) + uv.y() * m(1, 1) + uv_offset.y()) * height};
  }
  /// Their derivatives by uv.
  Eigen::Matrix2d uv_to_texels() const {
    return Vec2d(bitmap->width, bitmap->height).asDiagonal() * uv_to_texture;
  }
  Vec2d place(const Vec2d& uv) const { return uv_to_texture * uv + uv_offset; }
  /// The colour of the pattern, or of the nearest texel.
  Rgbd steps(const Vec2d& uv) const;
};

}  // namespace driftlight
