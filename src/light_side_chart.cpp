// SPDX-License-Identifier: Apache-2.0
#include "light_side_chart.h"

#include "driftlight/walk.h"

namespace driftlight {
namespace {

using Sample = PathSampler::Sample;

PathEnd emission_from(const Emitter& emitter) {
  if (std::holds_alternative<AreaEmitter>(emitter)) return PathEnd::AreaEmission;
  return is_point(emitter) ? PathEnd::PointEmission : PathEnd::DirectionalEmission;
}

/// Fills in coordinates, one block after the other.
class Coordinates {
 public:
  Coordinates(const PathPoints& points, Sample& path) : points_(points), path_(path) {}

  void add(const Vec3d& block) { path_.coordinates(path_.topology.block_count++) = block; }
  void add_direction(const Vec3d& from, const Vec3d& to) { add((to - from).normalized()); }
  /// The direction at vertex k, 0 is x_1, to vertex `next`, if it is free.
  void add_free(int k, int next) {
    if (!path_.topology.vertices[static_cast<std::size_t>(k)].delta)
      add_direction(point(k), point(next));
  }
  const Vec3d& point(int k) const { return points_.points[static_cast<std::size_t>(k)]; }

 private:
  const PathPoints& points_;
  Sample& path_;
};

/// Where the light comes to the disk across it that touches the scene's sphere.
Vec3d point_on_disk(const Scene& scene, const DirectionalEmitter& light, const Vec3d& p) {
  const Vec3d center = scene.center() - scene.radius() * light.direction;
  return p - light.direction.dot(p - center) * light.direction;
}

struct Positions : WalkVisitor<double> {
  std::array<Vec3d, kMaxPathLength> points;
  std::size_t index = 0;
  bool is_vertex = false;

  void vertex(int k) {
    index = static_cast<std::size_t>(k);
    is_vertex = true;
  }
  void position(const Shape&, const Vec3d& p) {
    if (is_vertex) points[index] = p;
    is_vertex = false;
  }
};

bool leads_through(const Scene& scene, const Sample& path, const PathPoints& points) {
  Positions positions;
  walk<double>(scene, path.topology, path.coordinates, positions);
  const double tolerance = 1e-6 * scene.radius();
  for (std::size_t k = 0; k < points.count; ++k)
    if (!((positions.points[k] - points.points[k]).norm() <= tolerance)) return false;
  return true;
}

}  // namespace

PathPoints points_of(const Scene& scene, const Sample& path) {
  PathPoints result;
  const PathTopology& topology = path.topology;
  if (topology.scatter_count == 0) return result;
  int block = topology.lens_block_count();
  Ray<double> ray =
      scene.camera().ray(path.coordinates(block++), lens_point(scene, topology, path.coordinates));
  for (std::size_t k = 0; k < topology.scatter_count; ++k) {
    const WalkVertex<double> x = arrive(scene, topology.vertices[k], ray);
    result.add(x.at.p, lobe_of(x.bsdf, x.vertex.delta));
    if (k + 1 == topology.scatter_count) break;
    ray.origin = x.at.p;
    if (x.vertex.delta)
      ray.direction = delta_direction(x.bsdf, x.surface(), x.w, x.vertex.scattering);
    else
      ray.direction = path.coordinates(block++);
  }
  return result;
}

std::optional<Sample> with_light_side(const Scene& scene, const Sample& path,
                                      const PathPoints& points, const Vec3d& end, int light_count) {
  Sample result = path;
  PathTopology& topology = result.topology;
  const Emitter& emitter = scene.emitters()[topology.emitter];
  topology.end = emission_from(emitter);
  topology.light_count = static_cast<std::uint8_t>(light_count);
  topology.block_count = 0;
  Coordinates coordinates(points, result);
  const int camera_count = topology.camera_count();
  const Vec3d lens = lens_point(scene, topology, path.coordinates);
  if (topology.has_lens) coordinates.add(lens);
  if (camera_count > 0) coordinates.add(scene.camera().coordinate(coordinates.point(0), lens));
  for (int k = 0; k + 1 < camera_count; ++k) coordinates.add_free(k, k + 1);
  const int first = topology.scatter_count - 1;
  if (const auto* parallel = std::get_if<DirectionalEmitter>(&emitter)) {
    coordinates.add(point_on_disk(scene, *parallel, coordinates.point(first)));
  } else {
    if (topology.end == PathEnd::AreaEmission) coordinates.add(end);
    coordinates.add_direction(end, coordinates.point(first));
  }
  for (int k = first; k > camera_count; --k) coordinates.add_free(k, k - 1);
  const PathTopology pattern = topology;
  if (trace(scene, pattern, result.coordinates, topology) != TraceStatus::Ok) return std::nullopt;
  if (!leads_through(scene, result, points)) return std::nullopt;
  return result;
}

}  // namespace driftlight
