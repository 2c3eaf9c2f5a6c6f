// SPDX-License-Identifier: Apache-2.0
/// Charts with a light side for paths that were found in some other way.
#pragma once

#include <optional>

#include "driftlight/chart_rule.h"
#include "driftlight/path_sampler.h"
#include "light_part.h"

namespace driftlight {

/// Where the scattering vertices of a path lie, x_1 first, and how they scatter.
struct PathPoints {
  std::array<Vec3d, kMaxPathLength> points;
  std::array<Lobe, kMaxPathLength> lobes;
  std::size_t count = 0;

  void add(const Vec3d& p, Lobe lobe) {
    points[count] = p;
    lobes[count++] = lobe;
  }
};

/// The vertices that a path from the sensor has so far, from its hits and directions.
PathPoints points_of(const Scene& scene, const PathSampler::Sample& path);

/// The path through these points to the point `end` on its emitter (anywhere on its light, of a
/// directional one) in its chart with `light_count` vertices on the light side. Of `path` only the
/// vertices and the emitter are used. Traced anew, as every state of the chain is; none if that
/// finds another path.
std::optional<PathSampler::Sample> with_light_side(const Scene& scene,
                                                   const PathSampler::Sample& path,
                                                   const PathPoints& points, const Vec3d& end,
                                                   int light_count);

}  // namespace driftlight
