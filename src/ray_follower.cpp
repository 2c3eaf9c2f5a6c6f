// SPDX-License-Identifier: Apache-2.0
#include "ray_follower.h"

namespace driftlight {

RayFollower leaving(const Scene& scene, const SurfaceHit& x, const Vec3d& v) {
  return {scene, x.at.p, scene.leave(x.at.p, x.at.n_g, v), v};
}

TraceStatus meet(RayFollower& ray, SurfaceHit& surface) {
  const Hit hit = ray.next_hit();
  if (!hit.valid()) return TraceStatus::Missed;
  surface = ray.surface(hit);
  // A ray that just touches a sphere in single precision may pass it in double.
  return surface.bsdf != nullptr && surface.at.p.allFinite() ? TraceStatus::Ok
                                                             : TraceStatus::Missed;
}

TraceStatus connection_status(const Scene& scene, const SurfaceHit& from, const Emitter& emitter,
                              const EmitterPoint& y) {
  const Vec3d edge = y.p - from.at.p;
  const auto* spot = std::get_if<SpotEmitter>(&emitter);
  if (spot != nullptr && !(spot->falloff(Vec3d(-edge.normalized())) > 0.0))
    return TraceStatus::Missed;
  const Vec3d start = scene.leave(from.at.p, from.at.n_g, edge);
  const auto* light = std::get_if<AreaEmitter>(&emitter);
  if (light == nullptr) return scene.occluded(start, y.p) ? TraceStatus::Occluded : TraceStatus::Ok;
  if (y.n.dot(edge) >= 0.0) return TraceStatus::Missed;
  // The first thing in this direction must be y itself: rounding decides nothing but the
  // primitive, and a part of the same shape in front of y is told apart by its distance.
  const Ray<double> ray{start, (y.p - start).normalized()};
  const Hit hit = scene.intersect(ray.origin, ray.direction);
  if (!hit.valid()) return TraceStatus::Missed;
  if (hit.shape != light->shape) return TraceStatus::Occluded;
  const double error = (scene.interact(hit, ray).p - y.p).norm();
  return error < 1e-3 * edge.norm() ? TraceStatus::Ok : TraceStatus::Occluded;
}

bool is_clear(const BlurredAreaEmitter& lamp, RayFollower& follower) {
  const Hit hit = follower.next_hit();
  if (!hit.valid()) return true;
  const Vec3d& origin = follower.ray().origin;
  return (follower.surface(hit).at.p - origin).norm() >= lamp.clearance(origin);
}

TraceStatus infinity_status(const Scene& scene, const SurfaceHit& from, const Vec3d& wo) {
  const Vec3d start = scene.leave(from.at.p, from.at.n_g, wo);
  return scene.occluded_to_infinity(start, wo) ? TraceStatus::Occluded : TraceStatus::Ok;
}

}  // namespace driftlight
