// SPDX-License-Identifier: Apache-2.0
#include "driftlight/texture.h"

#include <algorithm>

namespace driftlight {

Texture::Slopes Texture::slopes(const Vec2d& uv) const {
  if (is_constant()) return {Rgbd::Zero(), Rgbd::Zero()};
  const double width = bitmap->width;
  const double height = bitmap->height;
  const double x = (uv.x() * uv_scale.x() + uv_offset.x()) * width;
  const double y = (uv.y() * uv_scale.y() + uv_offset.y()) * height;
  const BilinearPatch patch(*bitmap, x, y, Wrap::Repeat, Wrap::Repeat);
  return {patch.slope_x(y) * (scale * uv_scale.x() * width),
          patch.slope_y(x) * (scale * uv_scale.y() * height)};
}

double Texture::maximum() const {
  if (is_constant()) return color.maxCoeff();
  double largest = 0;
  for (const auto& texel : bitmap->texels)
    largest = std::max(largest, static_cast<double>(texel.maxCoeff()));
  return largest * scale;
}

Rgbd Texture::average() const {
  if (is_constant()) return color;
  Rgbd sum = Rgbd::Zero();
  for (const auto& texel : bitmap->texels) sum += texel.cast<double>();
  return sum * (scale / static_cast<double>(bitmap->texels.size()));
}

}  // namespace driftlight
