// SPDX-License-Identifier: Apache-2.0
/// The textures of BSDFs.
#pragma once

#include <variant>

#include "driftlight/bsdf.h"

namespace driftlight {

/// Calls `visit` with each texture of the BSDF.
template <class Visit>
void for_each_texture(const Bsdf& bsdf, const Visit& visit) {
  struct Visitor {
    const Visit& visit;
    void operator()(const Diffuse& b) const { visit(b.reflectance); }
    void operator()(const Conductor& b) const { visit(b.specular_reflectance); }
    void operator()(const RoughConductor& b) const { visit(b.specular_reflectance); }
    void operator()(const Dielectric& b) const {
      visit(b.specular_reflectance);
      visit(b.specular_transmittance);
    }
    void operator()(const RoughDielectric& b) const {
      visit(b.specular_reflectance);
      visit(b.specular_transmittance);
    }
    void operator()(const Phong& b) const {
      visit(b.diffuse_reflectance);
      visit(b.specular_reflectance);
    }
    void operator()(const Ward& b) const {
      visit(b.diffuse_reflectance);
      visit(b.specular_reflectance);
    }
    void operator()(const Plastic& b) const {
      visit(b.base.reflectance);
      visit(b.specular_reflectance);
    }
    void operator()(const RoughPlastic& b) const {
      visit(b.base.reflectance);
      visit(b.specular_reflectance);
    }
    void operator()(const ThinDielectric& b) const {
      visit(b.specular_reflectance);
      visit(b.specular_transmittance);
    }
    void operator()(const Mask& b) const {
      visit(b.opacity);
      if (b.nested != nullptr) for_each_texture(b.nested->bsdf, visit);
    }
    void operator()(const Coating& b) const {
      visit(b.specular_reflectance);
      for_each_texture(b.nested->bsdf, visit);
    }
    void operator()(const Blend& b) const {
      visit(b.weight);
      for_each_texture(b.first->bsdf, visit);
      for_each_texture(b.second->bsdf, visit);
    }
  };
  std::visit(Visitor{visit}, bsdf);
}

/// True if some texture is not one colour.
inline bool is_textured(const Bsdf& bsdf) {
  bool result = false;
  for_each_texture(bsdf, [&](const Texture& texture) { result |= !texture.is_constant(); });
  return result;
}

}  // namespace driftlight
