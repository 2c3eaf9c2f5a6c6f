// SPDX-License-Identifier: Apache-2.0
/// The connection of light subpaths to the sensor (t = 1).
#pragma once

#include <optional>

#include "subpath.h"

namespace driftlight {

/// Whether the sensor sees the surface point from this point of its lens, through its film and past
/// the near plane.
bool sensor_sees(const Scene& scene, const SurfaceHit& x, const Vec3d& lens);

struct SensorConnection {
  Vec2d film{0, 0};     ///< in [0, 1)^2
  Vec3d wi{0, 0, 0};    ///< from the vertex to the sensor
  Rgbd value{0, 0, 0};  ///< unweighted contribution to the mean over the film
  double density = 0;   ///< of the vertex, per area, by rays from the sensor
};

/// From a uniform point of the lens. None if the vertex, which is not a delta one, is not seen or
/// scatters nothing to the sensor. The value is
///   throughput f_s |n_s . wo| |n_g . wi| / (|n_g . wo| r^2) W,   W = 1 / (A cos^3),
/// where the throughput is that of SubpathTracer.
std::optional<SensorConnection> connect_to_sensor(const Scene& scene, const SubpathVertex& y,
                                                  const Vec3d& lens);

}  // namespace driftlight
