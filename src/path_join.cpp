// SPDX-License-Identifier: Apache-2.0
#include "path_join.h"

#include "driftlight/walk.h"
#include "light_side_chart.h"

namespace driftlight {
namespace {

using Sample = PathSampler::Sample;

PathEnd end_at_infinity(const Emitter& emitter) {
  return is_environment(emitter) ? PathEnd::Environment : PathEnd::DirectionalConnection;
}

/// s = 1 from a surface: next-event estimation.
std::optional<Sample> connect_to_emitter(const Scene& scene, CameraPart& part,
                                         const LightPart& light) {
  Sample& path = part.path;
  PathTopology& topology = path.topology;
  const SurfaceHit& surface = *part.last;
  PathVertex& vertex = topology.vertices[topology.scatter_count - 1U];
  topology.emitter = light.emitter;
  if (vertex.delta) return std::nullopt;
  const Emitter& emitter = scene.emitters()[light.emitter];

  if (light.infinite) {
    if (!passes(surface.at, surface.wi, light.sky)) return std::nullopt;
    if (infinity_status(scene, surface, light.sky) != TraceStatus::Ok) return std::nullopt;
    vertex.scattering = surface.side(light.sky);
    topology.end = end_at_infinity(emitter);
    if (topology.end == PathEnd::DirectionalConnection) return path;
    path.coordinates(topology.block_count++) = light.sky;
    return path;
  }

  const EmitterPoint& y = light.point;
  const Vec3d edge = y.p - surface.at.p;
  if (!passes(surface.at, surface.wi, edge)) return std::nullopt;
  if (connection_status(scene, surface, emitter, y) != TraceStatus::Ok) return std::nullopt;
  vertex.scattering = surface.side(edge);
  const auto* area = std::get_if<AreaEmitter>(&emitter);
  if (area == nullptr) {
    topology.end = PathEnd::PointConnection;
  } else if (connects_to_area(lobe_of(*surface.bsdf, false), scene.shapes()[area->shape])) {
    topology.end = PathEnd::AreaConnection;
    path.coordinates(topology.block_count++) = y.p;
  } else {
    // The chart of this path is its last direction: find the primitive that it hits.
    const Vec3d wo = edge.normalized();
    const Vec3d start = scene.leave(surface.at.p, surface.at.n_g, wo);
    const Hit hit = scene.intersect(start, wo);
    if (hit.shape != area->shape) return std::nullopt;
    topology.end = PathEnd::Hit;
    topology.vertices[topology.scatter_count].hit = hit;
    path.coordinates(topology.block_count++) = wo;
  }
  return path;
}

/// Appends the vertices of the light part from the connection on, with their free directions, all
/// seen from the sensor. False if a pair of directions does not scatter.
bool append(const LightPart& light, const Vec3d& edge, Sample& path) {
  PathTopology& topology = path.topology;
  for (int i = light.count - 1; i >= 0; --i) {
    const LightPart::Vertex& x = light[i];
    PathVertex& vertex = topology.vertices[topology.scatter_count++];
    vertex.hit = x.hit;
    vertex.delta = x.delta;
    vertex.scattering = x.scattering;
    if (i + 1 == light.count) {
      if (x.delta || !passes(light.last->at, light.last->wi, -edge)) return false;
      vertex.scattering = light.last->side(-edge);
    }
    if (x.delta) continue;
    Vec3d& v = path.coordinates(topology.block_count++);
    if (i > 0)
      v = -light[i - 1].to_sensor;
    else
      v = light.infinite ? light.sky : Vec3d((light.point.p - x.p).normalized());
  }
  return true;
}

/// Gives a path of free directions the chart that its end has. False if it has none.
bool set_end(const Scene& scene, const LightPart& light, Sample& path) {
  PathTopology& topology = path.topology;
  topology.emitter = light.emitter;
  const Emitter& emitter = scene.emitters()[light.emitter];
  const auto* area = std::get_if<AreaEmitter>(&emitter);
  topology.end = PathEnd::Hit;
  if (light.infinite) topology.end = end_at_infinity(emitter);
  if (is_point(emitter)) topology.end = PathEnd::PointConnection;
  if (topology.ends_at_delta_emitter()) {
    // Its light comes straight to a surface: behind a delta lobe it has no coordinates.
    if (light.count == 0 || light[0].delta) return false;
    --topology.block_count;
  } else if (area != nullptr && light.count > 0 &&
             connects_to_area(lobe_of(*light[0].bsdf, light[0].delta),
                              scene.shapes()[area->shape])) {
    topology.end = PathEnd::AreaConnection;
    path.coordinates(topology.block_count - 1) = light.point.p;
  }
  return true;
}

/// s >= 1 in a chart with a light side.
std::optional<Sample> join_in_light_chart(const Scene& scene, CameraPart& part,
                                          const LightPart& light, PathPoints points,
                                          int light_count) {
  PathTopology& topology = part.path.topology;
  const bool to_sky = light.count == 0 && light.infinite;
  const Vec3d to = light.count > 0 ? light[light.count - 1].p : light.point.p;
  const Camera& camera = scene.camera();
  const Vec3d& lens = lens_point(scene, topology, part.path.coordinates);
  Vec3d edge = to_sky ? light.sky : camera.ray(camera.coordinate(to, lens), lens).direction;
  if (part.last && !to_sky) edge = to - part.last->at.p;
  if (part.last) {
    if (!passes(part.last->at, part.last->wi, edge)) return std::nullopt;
    topology.vertices[topology.scatter_count - 1U].scattering = part.last->side(edge);
  }
  if (!append(light, edge, part.path)) return std::nullopt;
  topology.emitter = light.emitter;
  for (int i = light.count - 1; i >= 0; --i)
    points.add(light[i].p, lobe_of(*light[i].bsdf, light[i].delta));
  return with_light_side(scene, part.path, points, light.point.p, light_count);
}

/// Lobes of the whole path, in order from the sensor, once those of the light part are added.
std::optional<int> light_side_of(const Scene& scene, const CameraPart& part, const LightPart& light,
                                 const PathPoints& camera) {
  std::array<Lobe, kMaxPathLength> lobes = camera.lobes;
  std::size_t count = camera.count;
  for (int i = light.count - 1; i >= 0; --i)
    lobes[count++] = lobe_of(*light[i].bsdf, light[i].delta);
  return light_side(part.path.topology.phase_space, scene, {lobes.data(), count}, light.emitter);
}

/// Where the vertices of a path lie, from x_1 on.
struct VertexPositions : WalkVisitor<double> {
  std::array<Vec3d, kMaxPathLength + 1> points;
  int count = 0;

  void position(const Shape&, const Vec3d& p) { points[static_cast<std::size_t>(count++)] = p; }
};

/// True if the last vertices of the path are those of the light part: then nothing stands in the
/// way of the connection.
bool contains(const Scene& scene, const Sample& path, const LightPart& light) {
  VertexPositions positions;
  walk<double>(scene, path.topology, path.coordinates, positions);
  int k = positions.count;
  const double tolerance = 1e-6 * scene.radius();
  const auto next_is = [&](const Vec3d& p) {
    return (positions.points[static_cast<std::size_t>(--k)] - p).norm() <= tolerance;
  };
  if (!light.infinite && !light.point.n.isZero(0.0) && !next_is(light.point.p)) return false;
  for (int i = 0; i < light.count; ++i)
    if (!next_is(light[i].p)) return false;
  return true;
}

/// s >= 1 in general. The joined path is traced anew from the sensor, as every state of the chain
/// is: that finds the primitives that its rays hit, and whatever blocks them.
std::optional<Sample> connect(const Scene& scene, CameraPart& part, const LightPart& light) {
  Sample& path = part.path;
  PathTopology& topology = path.topology;
  const Camera& camera = scene.camera();
  const Vec3d to = light.count > 0 ? light[light.count - 1].p : light.point.p;
  const bool to_sky = light.count == 0 && light.infinite;
  // No ray of an orthographic sensor comes to a direction that was drawn.
  if (to_sky && !part.last && camera.is_orthographic()) return std::nullopt;
  Vec3d edge = light.sky;
  Vec3d block = light.sky;
  if (!to_sky) {
    const Vec3d& lens = lens_point(scene, topology, path.coordinates);
    block = part.last ? Vec3d((to - part.last->at.p).normalized()) : camera.coordinate(to, lens);
    edge = part.last ? block : camera.ray(block, lens).direction;
  }
  if (part.last) {
    if (!passes(part.last->at, part.last->wi, edge)) return std::nullopt;
    topology.vertices[topology.scatter_count - 1U].scattering = part.last->side(edge);
  }
  path.coordinates(topology.block_count++) = block;
  if (!append(light, edge, path) || !set_end(scene, light, path)) return std::nullopt;
  const PathTopology pattern = topology;
  if (trace(scene, pattern, path.coordinates, topology) != TraceStatus::Ok) return std::nullopt;
  if (!contains(scene, path, light)) return std::nullopt;
  return path;
}

}  // namespace

CameraPart begin_camera_part(const Scene& scene, PhaseSpace phase_space, const Vec3d& v,
                             const Vec3d& lens) {
  CameraPart part{{}, RayFollower(scene, v, lens), std::nullopt};
  PathTopology& topology = part.path.topology;
  topology.phase_space = phase_space;
  topology.has_lens = scene.camera().has_lens();
  if (topology.has_lens) part.path.coordinates(topology.block_count++) = lens;
  return part;
}

std::optional<PathSampler::Sample> end_by_hit(const Scene& scene, CameraPart& part) {
  Sample& path = part.path;
  PathTopology& topology = path.topology;
  const Hit hit = part.follower.next_hit();
  if (!hit.valid()) {
    if (!scene.environment()) return std::nullopt;
    topology.end = PathEnd::Environment;
    topology.emitter = *scene.environment();
    return path;
  }
  const Shape& shape = scene.shapes()[hit.shape];
  if (!shape.emitter) return std::nullopt;
  const Interaction<double> at = scene.interact(hit, part.follower.ray());
  if (at.n_g.dot(part.follower.ray().direction) >= 0.0) return std::nullopt;  // the dark side
  topology.emitter = *shape.emitter;
  if (topology.phase_space == PhaseSpace::Bidirectional) {
    const PathPoints points = points_of(scene, path);
    const auto count = light_side(topology.phase_space, scene, {points.lobes.data(), points.count},
                                  *shape.emitter);
    if (count.value() > 0) return with_light_side(scene, path, points, at.p, *count);
  }
  if (part.last && connects_to_area(part.last_lobe(), shape)) {
    topology.end = PathEnd::AreaConnection;
    path.coordinates(topology.block_count - 1) = at.p;
  } else {
    topology.end = PathEnd::Hit;
    topology.vertices[topology.scatter_count].hit = hit;
  }
  return path;
}

/// The chart is that of the lamp itself, if it ends in a hit there.
std::optional<PathSampler::Sample> end_by_blurred_hit(const Scene& scene, CameraPart& part,
                                                      std::uint32_t emitter) {
  PathTopology& topology = part.path.topology;
  const auto& lamp = std::get<BlurredAreaEmitter>(scene.emitters()[emitter]);
  const Shape& shape = scene.shapes()[lamp.sharp().shape];
  if (part.last && connects_to_area(part.last_lobe(), shape)) return std::nullopt;
  if (topology.phase_space == PhaseSpace::Bidirectional) {
    const PathPoints points = points_of(scene, part.path);
    const auto count =
        light_side(topology.phase_space, scene, {points.lobes.data(), points.count}, emitter);
    if (count.value() > 0) return std::nullopt;
  }
  topology.end = PathEnd::Hit;
  topology.emitter = emitter;
  return part.path;
}

std::optional<PathSampler::Sample> join(const Scene& scene, CameraPart& part,
                                        const LightPart& light) {
  if (part.path.topology.phase_space == PhaseSpace::Bidirectional) {
    const PathPoints points = points_of(scene, part.path);
    const auto count = light_side_of(scene, part, light, points);
    if (!count) return std::nullopt;
    if (*count > 0) return join_in_light_chart(scene, part, light, points, *count);
  }
  if (light.count == 0 && part.last) return connect_to_emitter(scene, part, light);
  return connect(scene, part, light);
}

}  // namespace driftlight
