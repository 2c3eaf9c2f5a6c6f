// SPDX-License-Identifier: Apache-2.0
#include "found_path.h"

#include "path_join.h"

namespace driftlight {
namespace {

/// Adds the vertex that the edge to come is to leave.
PathVertex& add_vertex(const SurfaceHit& surface, CameraPart& part) {
  part.last = surface;
  PathVertex& vertex = part.path.topology.vertices[part.path.topology.scatter_count++];
  vertex.hit = surface.hit;
  return vertex;
}

/// Adds a vertex that the path leaves along wo.
void add_vertex(const SurfaceHit& surface, bool delta, const Vec3d& wo, CameraPart& part) {
  PathVertex& vertex = add_vertex(surface, part);
  vertex.delta = delta;
  vertex.scattering = surface.side(wo);
  if (!delta) part.path.coordinates(part.path.topology.block_count++) = wo;
  part.follower.leave(surface, wo);
}

/// Adds the vertex that the edge to come is to arrive at. Its wi is toward the emitter.
LightPart::Vertex& add_vertex(const SurfaceHit& surface, LightPart& part) {
  part.last = surface;
  LightPart::Vertex& vertex = part.vertices[static_cast<std::size_t>(part.count++)];
  vertex.p = surface.at.p;
  vertex.hit = surface.hit;
  vertex.bsdf = surface.bsdf;
  return vertex;
}

/// Adds a vertex that the light leaves along this direction.
void add_vertex(const SurfaceHit& surface, bool delta, const Vec3d& to_sensor, LightPart& part) {
  LightPart::Vertex& vertex = add_vertex(surface, part);
  vertex.delta = delta;
  vertex.to_sensor = to_sensor;
  vertex.scattering = surface.side(to_sensor);
}

/// With the direction of the first edge, if there is one before the edge to come.
CameraPart begin_with(const Scene& scene, PhaseSpace phase_space, const Vec3d& v, const Vec3d& lens,
                      bool has_edge) {
  CameraPart part = begin_camera_part(scene, phase_space, v, lens);
  if (has_edge) part.path.coordinates(part.path.topology.block_count++) = v;
  return part;
}

/// Direction toward the light of the edge that arrives at vertex i of the subpath from the sensor,
/// or leaves the scene behind its last one.
Vec3d direction_before(const FoundPath& found, int i) {
  if (i == found.from_sensor.size()) return found.end.p;
  return -found.from_sensor[i].surface.wi;
}

/// `count` surface vertices, each of which scatters but, for s > 0, the last.
CameraPart camera_part(const Scene& scene, const FoundPath& found, PhaseSpace phase_space,
                       int count) {
  const bool scatter_last = found.s == 0;
  CameraPart part = begin_with(scene, phase_space, found.v, found.lens, count > 0 || scatter_last);
  for (int i = 0; i < count; ++i) {
    const SubpathVertex& z = found.from_sensor[i];
    if (i + 1 < count || scatter_last)
      add_vertex(z.surface, z.delta, direction_before(found, i + 1), part);
    else
      add_vertex(z.surface, part);
  }
  return part;
}

LightPart light_part(const FoundPath& found) {
  LightPart light = light_part_from(found.end);
  for (int i = 0; i < found.s - 1; ++i) {
    const SubpathVertex& y = found.from_light[i];
    if (i + 1 < found.s - 1)
      add_vertex(y.surface, y.delta, -found.from_light[i + 1].surface.wi, light);
    else
      add_vertex(y.surface, light);
  }
  return light;
}

/// The last edge of the path that may be a connection, as a ray into a lamp may not; n + 1: none is
/// needed, as a ray finds the end; 0: there is none.
int joining_edge(const VertexPath& path) {
  if (path.connects(path.edges)) return path.edges;
  if (path.end.can_be_hit()) return path.edges + 1;
  int k = path.edges - 1;
  while (k > 0 && !path.connects(k)) --k;
  return k;
}

/// Where a ray from the side of wi comes to a point of the geometry, as Hit has it.
std::uint32_t primitive_from(const Geometry& geometry, const SurfaceHit& at, const Vec3d& wi) {
  const auto root = [&](bool flipped) { return (at.at.n_g.dot(wi) > 0.0) != flipped ? 0U : 1U; };
  if (const auto* sphere = std::get_if<Sphere>(&geometry)) return root(sphere->flip_normals);
  if (const auto* cylinder = std::get_if<Cylinder>(&geometry)) return root(cylinder->flip_normals);
  return at.hit.primitive;
}

/// x_k as a ray from the side of wi meets it: it may have been found from the other one.
SurfaceHit met_from(const Scene& scene, const VertexPath& path, int k, const Vec3d& wi) {
  SurfaceHit surface = path(k).surface;
  surface.wi = wi;
  surface.front = surface.at.n_g.dot(wi) > 0.0;
  surface.hit.primitive = primitive_from(scene.shapes()[surface.hit.shape].geometry, surface, wi);
  return surface;
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

std::optional<PathSampler::Sample> state_of(const Scene& scene, const VertexPath& path,
                                            PhaseSpace phase_space) {
  const int joint = joining_edge(path);
  if (joint == 0) return std::nullopt;
  CameraPart camera =
      begin_with(scene, phase_space, path.toward_light(0), scene.camera().origin, joint > 1);
  for (int k = 1; k < joint && k < path.edges; ++k) {
    const SurfaceHit surface = met_from(scene, path, k, -path.toward_light(k - 1));
    if (k + 1 < joint)
      add_vertex(surface, path(k).delta, path.toward_light(k), camera);
    else
      add_vertex(surface, camera);
  }
  if (joint > path.edges) return end_by_hit(scene, camera);
  LightPart light = light_part_from(path.end);
  for (int k = path.edges - 1; k >= joint; --k) {
    const SurfaceHit surface = met_from(scene, path, k, path.toward_light(k));
    if (k > joint)
      add_vertex(surface, path(k).delta, -path.toward_light(k - 1), light);
    else
      add_vertex(surface, light);
  }
  return join(scene, camera, light);
}

}  // namespace driftlight
