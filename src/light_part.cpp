// SPDX-License-Identifier: Apache-2.0
#include "light_part.h"

#include "emission.h"

namespace driftlight {
LightPart light_part_from(const LightEnd& end) {
  LightPart light;
  light.emitter = end.emitter;
  light.infinite = end.at_infinity();
  if (light.infinite)
    light.sky = end.p;
  else
    light.point = {.p = end.p, .n = end.n};
  return light;
}

std::optional<LightPart> sample_light_part(const Scene& scene, int surface_vertices, Rng& rng) {
  double u = rng.uniform();
  const std::uint32_t emitter = scene.sample_emitter(u);
  const Vec2d first = rng.uniform2();
  if (surface_vertices == 0) return light_part_from(light_end_from(scene, emitter, first));
  const Vec2d last = rng.uniform2();
  const Emission emission = emit(scene, emitter, {first.x(), first.y(), last.x(), last.y()});
  LightPart light = light_part_from(emission.end);
  RayFollower follower(scene, emission.origin, emission.start, emission.direction);
  while (true) {
    const Hit hit = follower.next_hit();
    if (!hit.valid()) return std::nullopt;
    const SurfaceHit surface = follower.surface(hit);
    if (surface.bsdf == nullptr) return std::nullopt;
    LightPart::Vertex& vertex = light.vertices[static_cast<std::size_t>(light.count++)];
    vertex.p = surface.at.p;
    vertex.hit = hit;
    vertex.bsdf = surface.bsdf;
    vertex.delta = is_delta(*surface.bsdf);  // of the last, whose lobe is not drawn
    if (light.count == surface_vertices) {
      light.last = surface;
      return light;
    }
    const auto next =
        driftlight::sample(*surface.bsdf, surface.surface(), surface.wi, rng.uniform3());
    if (!next || !passes(surface.at, surface.wi, next->wo)) return std::nullopt;
    vertex.delta = next->delta;
    vertex.scattering = next->scattering;
    vertex.to_sensor = next->wo;
    follower.leave(surface, next->wo);
  }
}

}  // namespace driftlight
