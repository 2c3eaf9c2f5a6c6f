// SPDX-License-Identifier: Apache-2.0
/// The textures of BSDFs.
#pragma once

#include <variant>

#include "driftlight/bsdf.h"
#include "nested_bsdfs.h"

namespace driftlight {

/// Calls `visit` with each texture of the BSDF. If that may be changed, BSDFs nested in it are
/// copied, as others may share them.
template <class AnyBsdf, class Visit>
void for_each_texture(AnyBsdf& bsdf, const Visit& visit) {
  std::visit(
      [&](auto& b) {
        if constexpr (requires { b.reflectance; }) visit(b.reflectance);
        if constexpr (requires { b.diffuse_reflectance; }) visit(b.diffuse_reflectance);
        if constexpr (requires { b.base; }) visit(b.base.reflectance);
        if constexpr (requires { b.specular_reflectance; }) visit(b.specular_reflectance);
        if constexpr (requires { b.specular_transmittance; }) visit(b.specular_transmittance);
        if constexpr (requires { b.opacity; }) visit(b.opacity);
        if constexpr (requires { b.weight; }) visit(b.weight);
      },
      bsdf);
  for_each_nested(bsdf, [&](auto& nested) { for_each_texture(nested, visit); });
}

/// True if some texture is not one colour.
inline bool is_textured(const Bsdf& bsdf) {
  bool result = false;
  for_each_texture(bsdf, [&](const Texture& texture) { result |= !texture.is_constant(); });
  return result;
}

}  // namespace driftlight
