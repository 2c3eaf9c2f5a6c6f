// SPDX-License-Identifier: Apache-2.0
/// The part of a path that is drawn from the light.
#pragma once

#include <optional>

#include "driftlight/random.h"
#include "light_end.h"

namespace driftlight {

/// Vertices in order from the emitter.
struct LightPart {
  struct Vertex {
    Vec3d p;
    Hit hit;
    const Bsdf* bsdf = nullptr;
    Vec3d to_sensor;  ///< direction of the edge that leaves it toward the sensor; not of the last
    bool delta = false;
    Scattering scattering = Scattering::Reflection;
  };

  std::uint32_t emitter = 0;
  bool infinite = false;  ///< the emitter is an environment or directional
  EmitterPoint point;     ///< on a point, spot or area emitter
  Vec3d sky;              ///< unit direction toward an emitter at infinity
  int count = 0;          ///< of surface vertices
  std::array<Vertex, kMaxPathLength> vertices;
  std::optional<SurfaceHit> last;  ///< the last surface vertex

  const Vertex& operator[](int i) const { return vertices[static_cast<std::size_t>(i)]; }
};

/// The light part that is an end alone.
LightPart light_part_from(const LightEnd& end);

/// Draws an emitter, a point on it (a direction, of an environment) and, for surface_vertices > 0,
/// an emitted ray and as many surface vertices by BSDF sampling, with the densities of
/// path_density.h. None if the ray is lost on the way.
std::optional<LightPart> sample_light_part(const Scene& scene, int surface_vertices, Rng& rng);

}  // namespace driftlight
