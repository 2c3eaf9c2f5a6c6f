// SPDX-License-Identifier: Apache-2.0
#include "driftlight/texture.h"

#include <algorithm>

namespace driftlight {

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
