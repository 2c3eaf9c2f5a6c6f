// SPDX-License-Identifier: Apache-2.0
/// What a scene asks of a machine and of the integrators.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "bsdf_textures.h"
#include "cli/arguments.h"
#include "driftlight/scene.h"

namespace driftlight::cli {

/// Calls `visit` with each texture of surfaces and of their emission.
template <class Visit>
void for_each_texture(const Scene& scene, const Visit& visit) {
  for (const Bsdf& bsdf : scene.bsdfs()) driftlight::for_each_texture(bsdf, visit);
  for (const Material& material : scene.materials())
    if (material.relief != nullptr) visit(material.relief->texture);
  for (const Emitter& emitter : scene.emitters()) {
    const auto* area = std::get_if<AreaEmitter>(&emitter);
    if (area != nullptr && area->texture != nullptr) visit(*area->texture);
  }
}

/// Bytes of meshes and bitmaps, without Embree's trees.
std::size_t memory_of(const Scene& scene);

/// What an integrator finds of a scene's light.
struct IntegratorLimits {
  Integrator integrator;
  std::string text;  ///< "all", "all but ..", or why it finds nothing
};

/// Of each integrator, with the defaults of its options, in their order.
std::vector<IntegratorLimits> limits_of(const Scene& scene);

}  // namespace driftlight::cli
