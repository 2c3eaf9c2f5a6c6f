// SPDX-License-Identifier: Apache-2.0
#include "found_path.h"

#include "path_join.h"

namespace driftlight {
namespace {

/// Direction toward the light of the edge that arrives at vertex i of the subpath from the sensor,
/// or leaves the scene behind its last one.
Vec3d direction_before(const FoundPath& found, int i) {
  if (i == found.from_sensor.size()) return found.end.p;
  return -found.from_sensor[i].surface.wi;
}

/// `count` surface vertices, each of which scatters but, for s > 0, the last.
CameraPart camera_part(const Scene& scene, const FoundPath& found, PhaseSpace phase_space,
                       int count) {
  CameraPart part = begin_camera_part(scene, phase_space, found.v, found.lens);
  PathTopology& topology = part.path.topology;
  const bool scatter_last = found.s == 0;
  if (count > 0 || scatter_last) part.path.coordinates(topology.block_count++) = found.v;
  for (int i = 0; i < count; ++i) {
    const SubpathVertex& z = found.from_sensor[i];
    part.last = z.surface;
    PathVertex& vertex = topology.vertices[topology.scatter_count++];
    vertex.hit = z.surface.hit;
    if (i + 1 == count && !scatter_last) break;
    vertex.delta = z.delta;
    const Vec3d wo = direction_before(found, i + 1);
    vertex.scattering = z.surface.side(wo);
    if (!z.delta) part.path.coordinates(topology.block_count++) = wo;
    part.follower.leave(z.surface, wo);
  }
  return part;
}

LightPart light_part(const FoundPath& found) {
  LightPart light = light_part_from(found.end);
  for (int i = 0; i < found.s - 1; ++i) {
    const SubpathVertex& y = found.from_light[i];
    LightPart::Vertex& vertex = light.vertices[static_cast<std::size_t>(light.count++)];
    vertex.p = y.surface.at.p;
    vertex.hit = y.surface.hit;
    vertex.bsdf = y.surface.bsdf;
    light.last = y.surface;
    if (i + 1 == found.s - 1) break;
    vertex.delta = y.delta;
    vertex.to_sensor = -found.from_light[i + 1].surface.wi;
    vertex.scattering = y.surface.side(vertex.to_sensor);
  }
  return light;
}

}  // namespace

std::optional<PathSampler::Sample> state_of(const Scene& scene, const FoundPath& found,
                                            PhaseSpace phase_space) {
  CameraPart camera =
      camera_part(scene, found, phase_space, found.s == 0 ? found.t - 2 : found.t - 1);
  if (found.s == 0 && scene.is_blurred(found.end.emitter))
    return end_by_blurred_hit(scene, camera, found.end.emitter);
  if (found.s == 0) return end_by_hit(scene, camera);
  return join(scene, camera, light_part(found));
}

}  // namespace driftlight
