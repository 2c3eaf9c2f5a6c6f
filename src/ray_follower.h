// SPDX-License-Identifier: Apache-2.0
/// A ray on its way through the scene, shared by tracing, path sampling and path tracing.
#pragma once

#include "driftlight/phase_space.h"
#include "driftlight/random.h"

namespace driftlight {

/// A surface point that a ray has come to.
struct SurfaceHit {
  Hit hit;
  Interaction<double> at;
  Vec3d wi;
  bool front;        ///< wi is on the side of the shape's outward normal
  const Bsdf* bsdf;  ///< null on the black back side of an opaque surface

  SurfacePoint<double> surface() const { return at.surface(); }
  Scattering side(const Vec3d& wo) const {
    return at.n_g.dot(wi) * at.n_g.dot(wo) > 0.0 ? Scattering::Reflection
                                                 : Scattering::Transmission;
  }
};

/// A point on the lens, uniform; without one the origin, and no numbers are drawn.
inline Vec3d sample_lens(const Camera& camera, Rng& rng) {
  return camera.has_lens() ? camera.lens_point(rng.uniform2()) : camera.origin;
}

class RayFollower {
 public:
  /// Starts at the sensor, at this point of its lens; v is the coordinate of the ray there.
  RayFollower(const Scene& scene, const Vec3d& v, const Vec3d& lens)
      : scene_(scene),
        ray_(scene.camera().ray(v, lens)),
        start_(ray_.origin),
        t_min_(scene.camera().near_clip / scene.camera().cosine(ray_.direction)),
        t_max_(scene.camera().far_clip / scene.camera().cosine(ray_.direction)) {}

  /// Starts at `origin`; `start` is the origin, moved off the surface that it lies on.
  RayFollower(const Scene& scene, const Vec3d& origin, const Vec3d& start, const Vec3d& v)
      : scene_(scene),
        ray_{origin, v},
        start_(start),
        t_min_(0.0),
        t_max_(std::numeric_limits<double>::infinity()) {}

  const Ray<double>& ray() const { return ray_; }

  Hit next_hit() {
    const Hit hit = scene_.intersect(start_, ray_.direction, t_min_, t_max_);
    t_min_ = 0.0;
    t_max_ = std::numeric_limits<double>::infinity();
    return hit;
  }

  /// The surface point of a valid hit of the current ray.
  SurfaceHit surface(const Hit& hit) const {
    SurfaceHit result{hit, scene_.interact(hit, ray_), -ray_.direction, false, nullptr};
    result.front = result.at.n_g.dot(result.wi) > 0.0;
    result.bsdf = scene_.bsdf_at(hit, result.wi, result.at);
    return result;
  }

  void leave(const SurfaceHit& from, const Vec3d& wo) {
    ray_ = {from.at.p, wo};
    start_ = scene_.leave(from.at.p, from.at.n_g, wo);
  }

 private:
  const Scene& scene_;
  Ray<double> ray_;
  Vec3d start_;  ///< the origin, moved off its surface
  double t_min_;
  double t_max_;
};

/// The ray that leaves a surface point along v.
RayFollower leaving(const Scene& scene, const SurfaceHit& x, const Vec3d& v);
/// The ray meets a surface that scatters; Missed, if it does not.
TraceStatus meet(RayFollower& ray, SurfaceHit& surface);
/// Whether light passes straight from the point y of a point, spot or area emitter to a surface
/// point. Missed: the point lies outside of a spot's cone, y shows its back, or something that is
/// not y is seen in its direction on the same shape.
TraceStatus connection_status(const Scene& scene, const SurfaceHit& from, const Emitter& emitter,
                              const EmitterPoint& y);
/// Whether light of a blurred lamp on the follower's ray reaches the ray's origin.
bool is_clear(const BlurredAreaEmitter& lamp, RayFollower& follower);
/// Whether light passes from infinity, out of the unit direction wo; Ok or Occluded.
TraceStatus infinity_status(const Scene& scene, const SurfaceHit& from, const Vec3d& wo);

}  // namespace driftlight
