// SPDX-License-Identifier: Apache-2.0
/// The walk along a path of fixed topology: the one place that turns coordinates into vertices.
///
/// The contribution, the constraints and the sampling density of a path are visitors of the walk.
/// It is pure in (scene, topology, coordinates): no Embree, no random numbers, no allocation.
#pragma once

#include "driftlight/path.h"
#include "driftlight/scene.h"

namespace driftlight {

/// A scattering event as visitors see it. The normals of `at` are on the side that `bsdf` expects.
template <Scalar T>
struct ScatterEvent {
  const Bsdf& bsdf;
  const Shape& shape;
  const Interaction<T>& at;
  const Vec3<T>& wi;
  const Vec3<T>& wo;
  Scattering scattering;

  SurfacePoint<T> surface() const { return {at.n_s, at.uv}; }
};

/// Does nothing; visitors derive from it and hide what they want to see.
template <Scalar T>
struct WalkVisitor {
  /// The first direction.
  void sensor(const PerspectiveCamera&, const Vec3<T>& /*v*/) {}
  /// A vertex on a surface, before the scattering there is visited; also the last one of
  /// PathEnd::Hit and PathEnd::AreaConnection.
  void position(const Shape&, const Vec3<T>& /*p*/) {}
  /// Scattering into a free direction.
  void scatter(const ScatterEvent<T>&) {}
  /// Scattering into a determined direction, by a delta lobe.
  void delta(const ScatterEvent<T>&) {}
  /// The ray that leaves the sensor or a vertex, for a visitor that changes its derivatives (never
  /// its value). `normal` is the geometric one of the surface left; the optical axis at the sensor.
  void depart(Ray<T>& /*ray*/, const Vec3<T>& /*normal*/) {}
  /// Scattering into the edge that connects to an emitter point.
  void connect(const ScatterEvent<T>&) {}
  /// The ends. `cosine` is that of the emitter's normal and `r2` the squared length of the edge.
  void hit(const AreaEmitter&, const T& /*cosine*/, const T& /*r2*/) {}
  void environment(const Emitter&, const Vec3<T>& /*v*/) {}
  void area_connection(const AreaEmitter&, const T& /*cosine*/, const T& /*r2*/) {}
  void point_connection(const PointEmitter&, const T& /*r2*/) {}
};

/// Outward normal of an emitter that can be connected to, at the point y on its surface.
template <Scalar T>
Vec3<T> emitter_normal(const Shape& shape, const Vec3<T>& y) {
  if (const auto* sphere = std::get_if<Sphere>(&shape.geometry)) {
    const double s = (sphere->flip_normals ? -1.0 : 1.0) / sphere->radius;
    return {(y.x() - sphere->center.x()) * s, (y.y() - sphere->center.y()) * s,
            (y.z() - sphere->center.z()) * s};
  }
  if (const auto* disk = std::get_if<Disk>(&shape.geometry))
    return constant<T>(Vec3d(disk->u.cross(disk->v).normalized()));
  return constant<T>(geometric_normal(std::get<TriangleMesh>(shape.geometry), 0));
}

/// Walks the path. `blocks(k)` gives block k as Vec3<T> (see PathCoordinates); each is asked for
/// once, in order.
template <Scalar T, class Blocks, class Visitor>
void walk(const Scene& scene, const PathTopology& topology, const Blocks& blocks,
          Visitor& visitor) {
  using std::sqrt;
  const PerspectiveCamera& camera = scene.camera();
  Ray<T> ray{constant<T>(camera.origin), blocks(0)};
  visitor.sensor(camera, ray.direction);
  visitor.depart(ray, constant<T>(camera.forward));
  int next_block = 1;
  for (int k = 0; k < topology.scatter_count; ++k) {
    const PathVertex& vertex = topology.vertices[static_cast<std::size_t>(k)];
    const Shape& shape = scene.shapes()[vertex.hit.shape];
    Interaction<T> at = scene.interact(vertex.hit, ray);
    const Vec3<T> wi = -ray.direction;
    // A displaced path may see a black back side: its front evaluates to zero there.
    const Bsdf* acting = scene.bsdf_at(vertex.hit, wi, at);
    const Bsdf& bsdf =
        acting != nullptr ? *acting : scene.bsdfs()[scene.materials()[shape.material].front];
    visitor.position(shape, at.p);
    const bool connects = topology.ends_in_connection() && k + 1 == topology.scatter_count;
    if (!connects) {
      ray.origin = at.p;
      if (vertex.delta) {
        ray.direction =
            delta_direction(bsdf, SurfacePoint<T>{at.n_s, at.uv}, wi, vertex.scattering);
        visitor.delta({bsdf, shape, at, wi, ray.direction, vertex.scattering});
      } else {
        ray.direction = blocks(next_block++);
        visitor.scatter({bsdf, shape, at, wi, ray.direction, vertex.scattering});
      }
      visitor.depart(ray, at.n_g);
      continue;
    }
    const Emitter& emitter = scene.emitters()[topology.emitter];
    const bool area = topology.end == PathEnd::AreaConnection;
    const Vec3<T> y =
        area ? Vec3<T>(blocks(next_block)) : constant<T>(std::get<PointEmitter>(emitter).position);
    const Vec3<T> edge = y - at.p;
    const T r2 = dot(edge, edge);
    const Vec3<T> wo = scaled(edge, constant<T>(1.0) / sqrt(r2));
    visitor.connect({bsdf, shape, at, wi, wo, vertex.scattering});
    if (area) {
      const auto& light = std::get<AreaEmitter>(emitter);
      const Shape& light_shape = scene.shapes()[light.shape];
      visitor.position(light_shape, y);
      visitor.area_connection(light, -dot(emitter_normal(light_shape, y), wo), r2);
    } else {
      visitor.point_connection(std::get<PointEmitter>(emitter), r2);
    }
    return;
  }

  const Emitter& emitter = scene.emitters()[topology.emitter];
  if (topology.end == PathEnd::Environment) {
    visitor.environment(emitter, ray.direction);
    return;
  }
  const PathVertex& last = topology.vertices[topology.scatter_count];
  const Interaction<T> at = scene.interact(last.hit, ray);
  visitor.position(scene.shapes()[last.hit.shape], at.p);
  const Vec3<T> edge = at.p - ray.origin;
  visitor.hit(std::get<AreaEmitter>(emitter), -dot(at.n_g, ray.direction), dot(edge, edge));
}

}  // namespace driftlight
