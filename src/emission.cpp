// SPDX-License-Identifier: Apache-2.0
#include "emission.h"

#include <cmath>

#include "driftlight/walk.h"
#include "emission_warp.h"

namespace driftlight {
namespace {

/// Area emitters that are spheres; null for all others.
const Sphere* sphere_of(const Scene& scene, const Emitter& emitter) {
  const auto* area = std::get_if<AreaEmitter>(&emitter);
  return area != nullptr ? std::get_if<Sphere>(&scene.shapes()[area->shape].geometry) : nullptr;
}

Emission leave_area(const Scene& scene, const LightEnd& end, const Vec3d& v, double cosine) {
  return {end, end.p, scene.leave(end.p, end.n, v), v, cosine, 1.0};
}

Emission emit_from_area(const Scene& scene, std::uint32_t emitter, const EmissionSample& u) {
  const auto& light = std::get<AreaEmitter>(scene.emitters()[emitter]);
  const EmittedRay<double> ray = warp_emission_from_area(scene.shapes()[light.shape], u);
  return leave_area(scene, area_end(scene, emitter, ray.from), ray.direction, ray.cosine);
}

Emission emit_from_point(const Scene& scene, const LightEnd& end, const EmissionSample& u) {
  const Vec3d v = warp_emission_from_point(scene.emitters()[end.emitter], u).direction;
  return {end, end.p, end.p, v, 1.0, end.falloff(v)};
}

Emission emit_from_infinity(const Scene& scene, const LightEnd& end, const EmissionSample& u) {
  const EmittedRay<double> ray = warp_emission_from_infinity(scene, end.p, u);
  return {end, ray.from.p, ray.from.p, -end.p, 1.0, 1.0};
}

}  // namespace

EmissionAxes invertible_axes(const Scene& scene, std::uint32_t index) {
  const Emitter& emitter = scene.emitters()[index];
  if (is_environment(emitter) || sphere_of(scene, emitter) != nullptr)
    return {true, true, true, true};
  const auto* area = std::get_if<AreaEmitter>(&emitter);
  const bool direction = area == nullptr || has_points(scene.shapes()[area->shape]);
  return {false, false, direction, direction};
}

Emission emit(const Scene& scene, std::uint32_t index, const EmissionSample& u) {
  const Emitter& emitter = scene.emitters()[index];
  if (std::holds_alternative<AreaEmitter>(emitter)) return emit_from_area(scene, index, u);
  const LightEnd end = light_end_from(scene, index, {u[0], u[1]});
  return end.at_infinity() ? emit_from_infinity(scene, end, u) : emit_from_point(scene, end, u);
}

Emission emit_from(const Scene& scene, const LightEnd& end, const Vec2d& u) {
  const EmissionSample sample{0.0, 0.0, u.x(), u.y()};
  if (end.at_infinity()) return emit_from_infinity(scene, end, sample);
  if (end.kind == LightEnd::Kind::Point) return emit_from_point(scene, end, sample);
  const Vec3d local = square_to_cosine_hemisphere(u.x(), u.y());
  return leave_area(scene, end, to_world(local, end.n), local.z());
}

EmissionSample emission_sample(const Scene& scene, std::uint32_t index, const Vec3d& p,
                               const Vec3d& v) {
  const Emitter& emitter = scene.emitters()[index];
  Vec2d first = Vec2d::Zero();
  Vec2d last = Vec2d::Zero();
  if (const Sphere* sphere = sphere_of(scene, emitter)) {
    const Vec3d place = to_local((p - sphere->center) / sphere->radius, v);
    first = sphere_to_square(v);
    last = disk_to_square(place.head<2>());
  } else if (const auto* area = std::get_if<AreaEmitter>(&emitter)) {
    const Shape& shape = scene.shapes()[area->shape];
    if (has_points(shape))
      last = cosine_hemisphere_to_square(to_local(v, emitter_normal(shape, p)));
  } else if (const auto* spot = std::get_if<SpotEmitter>(&emitter)) {
    last = spot->inverse(v);
  } else if (is_point(emitter)) {
    last = sphere_to_square(v);
  } else {
    const Vec3d toward = -v;
    const Vec3d place = to_local((p - scene.center()) / scene.radius(), toward);
    last = disk_to_square(place.head<2>());
    if (const auto* map = std::get_if<EnvironmentMap>(&emitter))
      first = map->inverse(toward);
    else if (is_environment(emitter))
      first = sphere_to_square(toward);
  }
  return {first.x(), first.y(), last.x(), last.y()};
}

double emission_density(const Scene& scene, const LightEnd& end, double cosine, double falloff) {
  switch (end.kind) {
    case LightEnd::Kind::Area:
      return cosine * kInvPi;
    case LightEnd::Kind::Point:
      return end.spot != nullptr ? falloff / end.spot->solid_angle() : 0.25 * kInvPi;
    case LightEnd::Kind::Environment:
    case LightEnd::Kind::Directional:
      break;
  }
  return kInvPi / (scene.radius() * scene.radius());
}

}  // namespace driftlight
