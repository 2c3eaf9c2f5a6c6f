// SPDX-License-Identifier: Apache-2.0
#include "light_part.h"

namespace driftlight {
namespace {

/// The emitted ray: its first hit is the first surface vertex.
RayFollower emit(const Scene& scene, const LightPart& light, Rng& rng) {
  const Vec2d u = rng.uniform2();
  if (light.infinite) {
    const Vec2d disk = square_to_disk(u.x(), u.y());
    const Vec3d origin =
        scene.center() + scene.radius() * to_world({disk.x(), disk.y(), 1.0}, light.sky);
    return RayFollower(scene, origin, origin, -light.sky);
  }
  if (light.point.n.isZero(0.0)) {
    const auto* spot = std::get_if<SpotEmitter>(&scene.emitters()[light.emitter]);
    const Vec3d v = spot != nullptr ? spot->sample(u.x(), u.y()) : square_to_sphere(u.x(), u.y());
    return RayFollower(scene, light.point.p, light.point.p, v);
  }
  const Vec3d v = to_world(square_to_cosine_hemisphere(u.x(), u.y()), light.point.n);
  return RayFollower(scene, light.point.p, scene.leave(light.point.p, light.point.n, v), v);
}

}  // namespace

std::optional<LightPart> sample_light_part(const Scene& scene, int surface_vertices, Rng& rng) {
  LightPart light;
  double u = rng.uniform();
  light.emitter = scene.sample_emitter(u);
  const Vec2d square = rng.uniform2();
  const Emitter& emitter = scene.emitters()[light.emitter];
  const auto* parallel = std::get_if<DirectionalEmitter>(&emitter);
  light.infinite = is_environment(emitter) || parallel != nullptr;
  if (const auto* map = std::get_if<EnvironmentMap>(&emitter))
    light.sky = map->sample(square.x(), square.y());
  else if (parallel != nullptr)
    light.sky = -parallel->direction;
  else if (light.infinite)
    light.sky = square_to_sphere(square.x(), square.y());
  else if (const auto* area = std::get_if<AreaEmitter>(&emitter))
    light.point = scene.sample_area(*area, square.x(), square.y());
  else
    light.point.p = position_of(emitter);
  if (surface_vertices == 0) return light;

  RayFollower follower = emit(scene, light, rng);
  while (true) {
    const Hit hit = follower.next_hit();
    if (!hit.valid()) return std::nullopt;
    const SurfaceHit surface = follower.surface(hit);
    if (surface.bsdf == nullptr) return std::nullopt;
    LightPart::Vertex& vertex = light.vertices[static_cast<std::size_t>(light.count++)];
    vertex.p = surface.at.p;
    vertex.hit = hit;
    vertex.bsdf = surface.bsdf;
    vertex.delta = is_delta(*surface.bsdf);
    if (light.count == surface_vertices) {
      light.last = surface;
      return light;
    }
    const auto next =
        driftlight::sample(*surface.bsdf, surface.surface(), surface.wi, rng.uniform3());
    if (!next || !passes(surface.at, surface.wi, next->wo)) return std::nullopt;
    vertex.scattering = next->scattering;
    vertex.to_sensor = next->wo;
    follower.leave(surface, next->wo);
  }
}

}  // namespace driftlight
