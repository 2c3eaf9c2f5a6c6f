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

// With texel coordinates (x, y) = A uv + b and H = d^2 c / dx dy of the patch:
//   c_uu = 2 A_xu A_yu H,  c_uv = (A_xu A_yv + A_xv A_yu) H,  c_vv = 2 A_xv A_yv H
Texture::Curvatures Texture::curvatures(const Vec2d& uv) const {
  if (!is_smooth()) return {Rgbd::Zero(), Rgbd::Zero(), Rgbd::Zero()};
  const Vec2d p = texel_place(uv);
  const Rgbd mixed = scale * BilinearPatch(*bitmap, p.x(), p.y(), wrap_u, wrap_v).mixed();
  const Eigen::Matrix2d a = uv_to_texels();
  return {2.0 * a(0, 0) * a(1, 0) * mixed, (a(0, 0) * a(1, 1) + a(0, 1) * a(1, 0)) * mixed,
          2.0 * a(0, 1) * a(1, 1) * mixed};
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
