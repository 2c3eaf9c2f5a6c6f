// SPDX-License-Identifier: Apache-2.0
#include "driftlight/texture.h"

#include <algorithm>
#include <cmath>

namespace driftlight {

Rgbd Texture::steps(const Vec2d& uv) const {
  const Vec2d p = place(uv);
  if (pattern) return scale * pattern->at(p);
  const int x = wrapped_index(std::floor(p.x() * bitmap->width), bitmap->width, wrap_u);
  const int y = wrapped_index(std::floor(p.y() * bitmap->height), bitmap->height, wrap_v);
  return scale * wrapped_texel(*bitmap, x, y);
}

Texture::Slopes Texture::slopes(const Vec2d& uv) const {
  if (bitmap == nullptr || pattern || !interpolates) return {Rgbd::Zero(), Rgbd::Zero()};
  const double width = bitmap->width;
  const double height = bitmap->height;
  const Vec2d p = place(uv);
  const double x = p.x() * width;
  const double y = p.y() * height;
  const BilinearPatch patch(*bitmap, x, y, wrap_u, wrap_v);
  const Rgbd slope_x = scale * patch.slope_x(y) * width;
  const Rgbd slope_y = scale * patch.slope_y(x) * height;
  const Eigen::Matrix2d& m = uv_to_texture;
  return {slope_x * m(0, 0) + slope_y * m(1, 0), slope_x * m(0, 1) + slope_y * m(1, 1)};
}

Rgbd Texture::maximum_color() const {
  if (is_constant()) return color;
  if (pattern) return scale * pattern->color0.max(pattern->color1);
  Eigen::Array3f largest = Eigen::Array3f::Zero();
  for (const Eigen::Array3f& texel : bitmap->texels) largest = largest.max(texel);
  if (wrap_u == Wrap::One || wrap_v == Wrap::One) largest = largest.max(1.0F);
  return scale * largest.cast<double>();
}

Rgbd Texture::average() const {
  if (is_constant()) return color;
  if (pattern)
    return scale * (pattern->color0 + pattern->share1() * (pattern->color1 - pattern->color0));
  Rgbd sum = Rgbd::Zero();
  for (const auto& texel : bitmap->texels) sum += texel.cast<double>();
  return scale * sum / static_cast<double>(bitmap->texels.size());
}

}  // namespace driftlight
