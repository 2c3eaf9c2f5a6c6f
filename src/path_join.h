// SPDX-License-Identifier: Apache-2.0
/// Paths from a part that was drawn from the sensor and one that was drawn from the light.
#pragma once

#include <optional>

#include "driftlight/chart_rule.h"
#include "driftlight/path_sampler.h"
#include "light_part.h"
#include "ray_follower.h"

namespace driftlight {

/// The part of a path that is drawn from the sensor: `path` holds its vertices, and its free
/// directions but that of the edge to come.
struct CameraPart {
  PathSampler::Sample path;
  RayFollower follower;            ///< the ray that leaves its last vertex, if that has scattered
  std::optional<SurfaceHit> last;  ///< the last vertex; none: the sensor

  /// Of the last vertex.
  Lobe last_lobe() const {
    return lobe_of(*last->bsdf, path.topology.vertices[path.topology.scatter_count - 1U].delta);
  }
};

/// Nothing but the sensor, and the ray of the coordinate v from this point of its lens.
CameraPart begin_camera_part(const Scene& scene, PhaseSpace phase_space, const Vec3d& v,
                             const Vec3d& lens);

/// Each uses up the camera part, and returns none if the path carries no light for certain.

/// s = 0: the ray that leaves the camera part meets an emitter or the environment.
std::optional<PathSampler::Sample> end_by_hit(const Scene& scene, CameraPart& part);
/// s = 0: the ray that leaves the camera part sees the blurred lamp of this index.
std::optional<PathSampler::Sample> end_by_blurred_hit(const Scene& scene, CameraPart& part,
                                                      std::uint32_t emitter);
/// s >= 1: an edge joins the two parts, whose facing ends are not delta vertices.
std::optional<PathSampler::Sample> join(const Scene& scene, CameraPart& part,
                                        const LightPart& light);

}  // namespace driftlight
