// SPDX-License-Identifier: Apache-2.0
#include "driftlight/path_sampler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "driftlight/walk.h"
#include "light_part.h"
#include "path_density.h"
#include "ray_follower.h"

namespace driftlight {
namespace {

using Sample = PathSampler::Sample;

/// The part of a path that is drawn from the sensor: `path` holds its vertices, and its free
/// directions but that of the edge to come.
struct CameraPart {
  Sample path;
  RayFollower follower;            ///< the ray that leaves its last vertex, if that has scattered
  std::optional<SurfaceHit> last;  ///< the last vertex; none: the sensor
};

/// Draws v_0 and `surface_vertices` vertices; the last of them scatters only if `scatter_last`.
std::optional<CameraPart> sample_camera_part(const Scene& scene, int surface_vertices,
                                             bool scatter_last, Rng& rng) {
  const Vec3d v = scene.camera().direction(rng.uniform2());
  CameraPart part{{}, RayFollower(scene, v), std::nullopt};
  PathTopology& topology = part.path.topology;
  if (surface_vertices == 0 && !scatter_last) return part;
  part.path.coordinates(topology.block_count++) = v;
  for (int k = 1; k <= surface_vertices; ++k) {
    const Hit hit = part.follower.next_hit();
    if (!hit.valid()) return std::nullopt;
    const SurfaceHit surface = part.follower.surface(hit);
    if (surface.bsdf == nullptr) return std::nullopt;
    part.last = surface;
    PathVertex& vertex = topology.vertices[topology.scatter_count++];
    vertex.hit = hit;
    vertex.delta = is_delta(*surface.bsdf);
    if (k == surface_vertices && !scatter_last) return part;
    const auto next =
        driftlight::sample(*surface.bsdf, surface.surface(), surface.wi, rng.uniform3());
    if (!next || !passes(surface.at, surface.wi, next->wo)) return std::nullopt;
    vertex.scattering = next->scattering;
    if (!vertex.delta) part.path.coordinates(topology.block_count++) = next->wo;
    part.follower.leave(surface, next->wo);
  }
  return part;
}

/// s = 0: the ray that leaves the camera part meets an emitter or the environment.
std::optional<Sample> end_by_hit(const Scene& scene, CameraPart& part) {
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
  if (part.last && connects_to_area(*part.last->bsdf, shape)) {
    topology.end = PathEnd::AreaConnection;
    path.coordinates(topology.block_count - 1) = at.p;
  } else {
    topology.end = PathEnd::Hit;
    topology.vertices[topology.scatter_count].hit = hit;
  }
  return path;
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
    const Vec3d start = scene.leave(surface.at.p, surface.at.n_g, light.sky);
    if (scene.occluded_to_infinity(start, light.sky)) return std::nullopt;
    vertex.scattering = surface.side(light.sky);
    topology.end = PathEnd::Environment;
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
  } else if (connects_to_area(*surface.bsdf, scene.shapes()[area->shape])) {
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
  if (light.infinite) {
    topology.end = PathEnd::Environment;
    return true;
  }
  topology.end = PathEnd::Hit;
  const auto* area = std::get_if<AreaEmitter>(&scene.emitters()[light.emitter]);
  if (area == nullptr) {
    // The light of a point comes straight from it: behind a delta lobe it has no coordinates.
    if (light.count == 0 || light[0].delta) return false;
    topology.end = PathEnd::PointConnection;
    --topology.block_count;
  } else if (light.count > 0 && connects_to_area(*light[0].bsdf, scene.shapes()[area->shape])) {
    topology.end = PathEnd::AreaConnection;
    path.coordinates(topology.block_count - 1) = light.point.p;
  }
  return true;
}

/// Where the vertices of a path lie, from x_1 on.
struct Positions : WalkVisitor<double> {
  std::array<Vec3d, kMaxPathLength + 1> points;
  int count = 0;

  void position(const Shape&, const Vec3d& p) { points[static_cast<std::size_t>(count++)] = p; }
};

/// True if the last vertices of the path are those of the light part: then nothing stands in the
/// way of the connection.
bool contains(const Scene& scene, const Sample& path, const LightPart& light) {
  Positions positions;
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
  const Vec3d& from = part.last ? part.last->at.p : scene.camera().origin;
  const Vec3d to = light.count > 0 ? light[light.count - 1].p : light.point.p;
  const bool to_sky = light.count == 0 && light.infinite;
  const Vec3d edge = to_sky ? light.sky : Vec3d((to - from).normalized());
  if (part.last) {
    if (!passes(part.last->at, part.last->wi, edge)) return std::nullopt;
    topology.vertices[topology.scatter_count - 1U].scattering = part.last->side(edge);
  }
  path.coordinates(topology.block_count++) = edge;
  if (!append(light, edge, path) || !set_end(scene, light, path)) return std::nullopt;
  const PathTopology pattern = topology;
  if (trace(scene, pattern, path.coordinates, topology) != TraceStatus::Ok) return std::nullopt;
  if (!contains(scene, path, light)) return std::nullopt;
  return path;
}

}  // namespace

PathSampler::PathSampler(const Scene& scene, int max_depth, LargeSteps large_steps, int min_depth)
    : scene_(scene), first_of_length_{0} {
  for (int n = 1; n <= max_depth; ++n) {
    first_of_length_.push_back(entry_count());
    if (n < min_depth) continue;
    const int most = large_steps == LargeSteps::Bdpt ? n : std::min(n - 1, 1);
    for (int s = 0; s <= most; ++s) strategies_.push_back({n, s});
  }
  first_of_length_.push_back(entry_count());
  table_ = DiscreteDistribution(spread(1.0));
}

/// A probability spread evenly, one half over all entries and the other over s <= 1: these are few,
/// and find what no other strategy can, light behind mirrors and glass.
std::vector<double> PathSampler::spread(double probability) const {
  const auto from_sensor = [](const Strategy& e) { return e.light_vertices <= 1; };
  const auto count = std::count_if(strategies_.begin(), strategies_.end(), from_sensor);
  std::vector<double> result;
  result.reserve(strategies_.size());
  for (const Strategy& e : strategies_)
    result.push_back(0.5 * probability *
                     (1.0 / static_cast<double>(strategies_.size()) +
                      (from_sensor(e) ? 1.0 / static_cast<double>(count) : 0.0)));
  return result;
}

void PathSampler::learn(const std::vector<RunningMean>& weights) {
  double energy = 0;
  double spread_total = 0;
  for (const RunningMean& w : weights) {
    energy += w.sum;
    spread_total += std::sqrt(w.sum_of_squares);
  }
  if (!(energy > 0.0)) return;
  std::vector<double> probabilities = spread(0.1);
  for (std::size_t i = 0; i < weights.size(); ++i)
    probabilities[i] +=
        0.45 * weights[i].sum / energy + 0.45 * std::sqrt(weights[i].sum_of_squares) / spread_total;
  table_ = DiscreteDistribution(probabilities);
}

std::optional<PathSampler::Sample> PathSampler::sample(Rng& rng) const {
  double u = rng.uniform();
  const int entry = table_.sample(u);
  const auto [n, s] = strategies_[static_cast<std::size_t>(entry)];
  auto camera = sample_camera_part(scene_, s == 0 ? n - 1 : n - s, s == 0, rng);
  if (!camera) return std::nullopt;
  camera->path.entry = entry;
  if (s == 0) return end_by_hit(scene_, *camera);
  const bool camera_is_delta = camera->last && is_delta(*camera->last->bsdf);
  if (camera_is_delta) return std::nullopt;
  const auto light = sample_light_part(scene_, s - 1, rng);
  if (!light) return std::nullopt;
  if (s == 1 && camera->last) return connect_to_emitter(scene_, *camera, *light);
  return connect(scene_, *camera, *light);
}

double PathSampler::log_density(const PathTopology& topology,
                                const PathCoordinates& coordinates) const {
  const auto n = static_cast<std::size_t>(topology.length());
  const bool too_long = n + 1 >= first_of_length_.size();
  if (too_long || first_of_length_[n] == first_of_length_[n + 1])
    return -std::numeric_limits<double>::infinity();
  const StrategyDensities q = strategy_densities(scene_, topology, coordinates);
  const int first = first_of_length_[n];
  const int end = first_of_length_[n + 1];
  double sum = 0;
  for (int entry = first; entry < end; ++entry)
    sum += table_.probability(entry) * q.by_light_vertices[static_cast<std::size_t>(entry - first)];
  return std::log(sum);
}

}  // namespace driftlight
