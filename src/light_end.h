// SPDX-License-Identifier: Apache-2.0
/// The light's end of a path, for the bidirectional integrators: how it is drawn, what it emits,
/// and with which densities.
#pragma once

#include <optional>

#include "driftlight/random.h"
#include "ray_follower.h"

namespace driftlight {

/// A point on an emitter. An environment or a directional emitter is a point at infinity: the
/// measure of the former is solid angle, and an edge to it has neither a cosine at its far end nor
/// 1 / r^2.
struct LightEnd {
  enum class Kind : std::uint8_t { Area, Point, Environment, Directional };

  Kind kind = Kind::Area;
  std::uint32_t emitter = 0;
  /// Position; at infinity, and of a blurred area emitter, the unit direction toward it.
  Vec3d p{0, 0, 0};
  Vec3d n{0, 0, 0};                   ///< unit normal of an area emitter, on the side that emits
  const SpotEmitter* spot = nullptr;  ///< of a point that is one
  /// Radiance; intensity of a point, of a spot on its axis; irradiance of a directional emitter.
  Rgbd emitted{0, 0, 0};
  /// Of emitter sampling: probability of the emitter, times 1 / area or the density of the
  /// direction.
  double density = 0;

  bool at_infinity() const { return kind == Kind::Environment || kind == Kind::Directional; }
  /// False if no ray from elsewhere can end here.
  bool can_be_hit() const { return kind == Kind::Area || kind == Kind::Environment; }
  /// Share of `emitted` that leaves along the unit direction v: that of a spot, else 1.
  double falloff(const Vec3d& v) const { return spot != nullptr ? spot->falloff(v) : 1.0; }
};

/// Draws an emitter and a point on it.
LightEnd sample_light_end(const Scene& scene, Rng& rng);
/// The point of the emitter of this index that a point of the unit square makes.
LightEnd light_end_from(const Scene& scene, std::uint32_t index, const Vec2d& square);
/// A given point on the area emitter of this index.
LightEnd area_end(const Scene& scene, std::uint32_t index, const EmitterPoint& y);
/// The end of a ray that has come to the surface; none if nothing is emitted toward it.
std::optional<LightEnd> light_end_at(const Scene& scene, const SurfaceHit& surface);
/// The end of a ray that leaves the scene; none without an environment.
std::optional<LightEnd> light_end_toward(const Scene& scene, const Vec3d& direction);

/// The edge from a surface point to a light end; 1 / r^2 and the cosine are 1 where there are none.
struct LightEdge {
  Vec3d direction;  ///< unit, away from the surface
  double inverse_r2;
  double cosine;   ///< at the light end; not positive on the dark side
  double falloff;  ///< of `emitted`; 0 outside of a spot's cone

  bool lit() const { return cosine > 0.0 && falloff > 0.0; }
};
LightEdge edge_to(const LightEnd& end, const Vec3d& p);

/// Whether light passes along that edge.
bool reaches(const Scene& scene, const LightEnd& end, const SurfaceHit& surface,
             const LightEdge& edge);

}  // namespace driftlight
