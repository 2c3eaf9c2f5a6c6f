// SPDX-License-Identifier: Apache-2.0
/// Rays that leave the light: how they are drawn from numbers, and how these are found again.
#pragma once

#include <array>

#include "light_end.h"

namespace driftlight {

/// Numbers in [0, 1) that an emitted ray is drawn from (a primary sample); uniform ones make rays
/// of the density end.density * emission_density.
///
///   emitter                  first two                 last two
///   planar area              point on it               direction, by the cosine about the normal
///   sphere                   direction                 point, across the direction
///   other mesh               point on it               direction, by the cosine about the normal
///   point, spot              -                         direction
///   environment              direction                 point on a disk of the scene's radius
///   directional              -                         point on that disk
using EmissionSample = std::array<double, 4>;

/// Which of them have an inverse: a point on a mesh has none, and nothing of a mesh that is not
/// planar.
using EmissionAxes = std::array<bool, 4>;
EmissionAxes invertible_axes(const Scene& scene, std::uint32_t index);

/// A ray that leaves a light end.
struct Emission {
  LightEnd end;
  Vec3d origin;
  Vec3d start;  ///< the origin, moved off its surface
  Vec3d direction;
  double cosine;   ///< with the normal of an area emitter; else 1
  double falloff;  ///< of `end.emitted`, along the direction
};

/// The ray that a sample makes of the emitter of this index.
Emission emit(const Scene& scene, std::uint32_t index, const EmissionSample& u);

/// A ray that leaves this end, from two numbers in [0, 1): into a direction by the cosine, of a
/// point or spot by its intensity; from infinity through a uniform point of the disk. Uniform
/// numbers make rays of the density emission_density.
Emission emit_from(const Scene& scene, const LightEnd& end, const Vec2d& u);

/// The sample of a ray along the unit direction v through p, a point on a finite emitter or any
/// point of the ray of one at infinity; 0 on axes without an inverse.
EmissionSample emission_sample(const Scene& scene, std::uint32_t index, const Vec3d& p,
                               const Vec3d& v);

/// Density of the ray that leaves the end, for a cosine > 0 with its normal:
///   area cos / pi per solid angle, point 1 / (4 pi) per solid angle, spot falloff / (its
///   integral), at infinity 1 / (pi R^2) per area across the ray, R the radius of the scene.
double emission_density(const Scene& scene, const LightEnd& end, double cosine, double falloff);

}  // namespace driftlight
