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

  SurfacePoint<T> surface() const { return at.surface(); }
};

/// Does nothing; visitors derive from it and hide what they want to see.
template <Scalar T>
struct WalkVisitor {
  /// The point on the lens that the path begins at, before `leave_point` there; no event without a
  /// lens.
  void lens(const Camera&, const Vec3<T>& /*p*/) {}
  /// The coordinate of the first ray (sensor.h), from this point of the lens: its direction, but
  /// for an orthographic camera.
  void sensor(const Camera&, const Vec3<T>& /*v*/, const Vec3<T>& /*lens*/) {}
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
  /// In the place of `depart` at an orthographic sensor: coordinates move the origin of the ray
  /// alone.
  void depart_parallel(Ray<T>& /*ray*/) {}
  /// Scattering into the edge that connects to an emitter point.
  void connect(const ScatterEvent<T>&) {}
  /// The ends. `cosine` is that of the emitter's normal and `r2` the squared length of the edge.
  void hit(const AreaEmitter&, const T& /*cosine*/, const T& /*r2*/) {}
  void environment(const Emitter&, const Vec3<T>& /*v*/) {}
  /// In the place of `hit`, and of `position` there.
  void blurred_hit(const BlurredAreaEmitter&, const Ray<T>&) {}
  void area_connection(const AreaEmitter&, const T& /*cosine*/, const T& /*r2*/) {}
  /// A point or spot emitter; `wo` is the unit direction toward it.
  void point_connection(const Emitter&, const Vec3<T>& /*wo*/, const T& /*r2*/) {}
  void directional_connection(const DirectionalEmitter&) {}

  /// The radiance of an area emitter over `radiance`, if it has a texture: after `hit`,
  /// `area_connection` or `area_emission`.
  void emission_texture(const Texture&, const Vec2<T>& /*uv*/) {}

  // Of paths with a light side, whose walk is: the sensor's side up to the vertex before the last,
  // the light side likewise, and then the two last vertices with the edge that joins them.

  /// The light side begins.
  void light_side() {}
  /// A point that the light, or the ray from a lens, leaves from, for a visitor that changes its
  /// derivatives (never its value).
  void leave_point(Vec3<T>& /*y*/) {}
  /// Emission along v, `normal` that of the emitter at y.
  void area_emission(const AreaEmitter&, const Vec3<T>& /*normal*/, const Vec3<T>& /*v*/) {}
  void point_emission(const Emitter&, const Vec3<T>& /*v*/) {}
  /// `offset` from the centre of the disk across the light, in units of its radius.
  void directional_emission(const DirectionalEmitter&, const Vec3<T>& /*offset*/) {}
  /// Light of an environment along v, `offset` as that of a directional emitter.
  void environment_emission(const Emitter&, const Vec3<T>& /*offset*/, const Vec3<T>& /*v*/) {}
  /// Scattering on the light side; wi is toward the sensor, as everywhere.
  void light_scatter(const ScatterEvent<T>&) {}
  void light_delta(const ScatterEvent<T>&) {}
  /// Scattering from the light into the joining edge.
  void light_connect(const ScatterEvent<T>&) {}
  /// The joining edge has this squared length; to the sensor, this Camera::spread.
  void joined(const T& /*r2*/) {}
  /// The events to come are at vertex k, 0 is x_1.
  void vertex(int /*k*/) {}
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

/// Texture coordinates of such an emitter there.
template <Scalar T>
Vec2<T> emitter_uv(const Shape& shape, const Vec3<T>& y) {
  if (const auto* sphere = std::get_if<Sphere>(&shape.geometry)) {
    const double s = 1.0 / sphere->radius;
    const Vec3<T> n{(y.x() - sphere->center.x()) * s, (y.y() - sphere->center.y()) * s,
                    (y.z() - sphere->center.z()) * s};
    return sphere_uv(*sphere, n);
  }
  if (const auto* disk = std::get_if<Disk>(&shape.geometry)) return disk_uv(*disk, y);
  return triangle_uv(std::get<TriangleMesh>(shape.geometry), 0, y);
}

/// A vertex that a ray has come to: w points back along the ray.
template <Scalar T>
struct WalkVertex {
  const PathVertex& vertex;
  const Shape& shape;
  Interaction<T> at;
  Vec3<T> w;
  const Bsdf& bsdf;

  SurfacePoint<T> surface() const { return at.surface(); }
  /// The event with the two directions in the order of the path.
  ScatterEvent<T> event(const Vec3<T>& wi, const Vec3<T>& wo) const {
    return {bsdf, shape, at, wi, wo, vertex.scattering};
  }
};

template <Scalar T>
WalkVertex<T> arrive(const Scene& scene, const PathVertex& vertex, const Ray<T>& ray) {
  const Shape& shape = scene.shapes()[vertex.hit.shape];
  Interaction<T> at = scene.interact(vertex.hit, ray);
  const Vec3<T> w = -ray.direction;
  // A displaced path may see a black back side: its front evaluates to zero there.
  const Bsdf* acting = scene.bsdf_at(vertex.hit, w, at);
  const Bsdf& bsdf =
      acting != nullptr ? *acting : scene.bsdfs()[scene.materials()[shape.material].front];
  return {vertex, shape, at, w, bsdf};
}

/// Block k at a vertex, which it may depend on.
template <Scalar T, class Blocks>
Vec3<T> free_direction(const Blocks& blocks, int k, const WalkVertex<T>& x) {
  if constexpr (requires { blocks(k, x); })
    return blocks(k, x);
  else
    return blocks(k);
}

/// Outward normal of the emitter at the block y, which coordinates may know better.
template <Scalar T, class Blocks>
Vec3<T> normal_at_end(const Blocks& blocks, const Shape& shape, const Vec3<T>& y) {
  if constexpr (requires { blocks.emitter_normal(); })
    return blocks.emitter_normal();
  else
    return emitter_normal(shape, y);
}

/// Likewise its texture coordinates.
template <Scalar T, class Blocks>
Vec2<T> uv_at_end(const Blocks& blocks, const Shape& shape, const Vec3<T>& y) {
  if constexpr (requires { blocks.emitter_uv(); })
    return blocks.emitter_uv();
  else
    return emitter_uv(shape, y);
}

/// The point on the lens that the path begins at, its first block; of a camera without one the
/// origin.
template <Scalar T, class Blocks, class Visitor>
Vec3<T> begin_at_lens(const Camera& camera, const PathTopology& topology, const Blocks& blocks,
                      Visitor& visitor) {
  if (!topology.has_lens) return constant<T>(camera.origin);
  Vec3<T> p = blocks(0);
  visitor.lens(camera, p);
  visitor.leave_point(p);
  return p;
}

/// The ray that leaves the sensor at this point of the lens, v its coordinate.
template <Scalar T, class Visitor>
Ray<T> leave_sensor(const Camera& camera, const Vec3<T>& v, const Vec3<T>& lens, Visitor& visitor) {
  visitor.sensor(camera, v, lens);
  Ray<T> ray = camera.ray(v, lens);
  if (camera.is_orthographic())
    visitor.depart_parallel(ray);
  else
    visitor.depart(ray, constant<T>(camera.forward));
  return ray;
}

/// The walk along a path with a light side.
template <Scalar T, class Blocks, class Visitor>
class TwoSidedWalk {
 public:
  TwoSidedWalk(const Scene& scene, const PathTopology& topology, const Blocks& blocks,
               Visitor& visitor)
      : scene_(scene), topology_(topology), blocks_(blocks), visitor_(visitor) {}

  void run() {
    const Vec3<T> lens = begin_at_lens<T>(scene_.camera(), topology_, blocks_, visitor_);
    next_block_ = topology_.lens_block_count();
    if (topology_.camera_count() == 0) {
      const WalkVertex<T> y = light_side();
      return join(scene_.camera(), lens, y);
    }
    const WalkVertex<T> x = camera_side(lens);
    const WalkVertex<T> y = light_side();
    join(x, y);
  }

 private:
  const PathVertex& vertex(int k) const { return topology_.vertices[static_cast<std::size_t>(k)]; }

  WalkVertex<T> camera_side(const Vec3<T>& lens) {
    Ray<T> ray = leave_sensor<T>(scene_.camera(), blocks_(next_block_++), lens, visitor_);
    const int last = topology_.camera_count() - 1;
    for (int k = 0; k < last; ++k) {
      const WalkVertex<T> x = arrive(scene_, vertex(k), ray);
      visitor_.vertex(k);
      visitor_.position(x.shape, x.at.p);
      leave(x, ray);
      if (x.vertex.delta)
        visitor_.delta(x.event(x.w, ray.direction));
      else
        visitor_.scatter(x.event(x.w, ray.direction));
      visitor_.depart(ray, x.at.n_g);
    }
    return arrive(scene_, vertex(last), ray);
  }

  WalkVertex<T> light_side() {
    visitor_.light_side();
    Ray<T> ray = emit();
    const int last = topology_.camera_count();
    for (int k = topology_.scatter_count - 1; k > last; --k) {
      const WalkVertex<T> x = arrive(scene_, vertex(k), ray);
      visitor_.vertex(k);
      visitor_.position(x.shape, x.at.p);
      leave(x, ray);
      if (x.vertex.delta)
        visitor_.light_delta(x.event(ray.direction, x.w));
      else
        visitor_.light_scatter(x.event(ray.direction, x.w));
      visitor_.depart(ray, x.at.n_g);
    }
    return arrive(scene_, vertex(last), ray);
  }

  /// The emitted ray.
  Ray<T> emit() {
    const Emitter& emitter = scene_.emitters()[topology_.emitter];
    if (topology_.end == PathEnd::PointEmission) {
      Ray<T> ray{constant<T>(position_of(emitter)), blocks_(next_block_++)};
      visitor_.point_emission(emitter, ray.direction);
      visitor_.depart(ray, ray.direction);
      return ray;
    }
    Vec3<T> y = blocks_(next_block_++);
    if (const auto* parallel = std::get_if<DirectionalEmitter>(&emitter)) {
      const Vec3d center = scene_.center() - scene_.radius() * parallel->direction;
      visitor_.directional_emission(
          *parallel, scaled(Vec3<T>(y - constant<T>(center)), constant<T>(1.0 / scene_.radius())));
      visitor_.leave_point(y);
      return {y, constant<T>(parallel->direction)};
    }
    if (topology_.end == PathEnd::Environment) {
      const Vec3<T> v = blocks_(next_block_++);
      visitor_.environment_emission(
          emitter,
          scaled(Vec3<T>(y - constant<T>(scene_.center())), constant<T>(1.0 / scene_.radius())), v);
      return {y, v};
    }
    const auto& light = std::get<AreaEmitter>(emitter);
    const Shape& shape = scene_.shapes()[light.shape];
    visitor_.position(shape, y);
    visitor_.leave_point(y);
    const Vec3<T> normal = normal_at_end(blocks_, shape, y);
    Ray<T> ray{y, blocks_(next_block_++)};
    visitor_.area_emission(light, normal, ray.direction);
    if (light.texture != nullptr)
      visitor_.emission_texture(*light.texture, uv_at_end(blocks_, shape, y));
    visitor_.depart(ray, normal);
    return ray;
  }

  /// The ray that leaves x on its side of the path.
  void leave(const WalkVertex<T>& x, Ray<T>& ray) {
    ray.origin = x.at.p;
    ray.direction = x.vertex.delta ? delta_direction(x.bsdf, x.surface(), x.w, x.vertex.scattering)
                                   : free_direction(blocks_, next_block_++, x);
  }

  void join(const WalkVertex<T>& x, const WalkVertex<T>& y) {
    const T r2 = aim(x.at.p, y.at.p);
    visitor_.vertex(topology_.camera_count() - 1);
    visitor_.position(x.shape, x.at.p);
    visitor_.connect(x.event(x.w, edge_));
    join_light(y, r2);
  }
  void join(const Camera& camera, const Vec3<T>& lens, const WalkVertex<T>& y) {
    const Vec3<T> v = camera.coordinate(y.at.p, lens);
    visitor_.sensor(camera, v, lens);
    edge_ = camera.ray(v, lens).direction;
    join_light(y, camera.spread(v, y.at.p, lens));
  }
  /// Sets the unit direction of the joining edge; its squared length.
  T aim(const Vec3<T>& from, const Vec3<T>& to) {
    using std::sqrt;
    const Vec3<T> edge = to - from;
    const T r2 = dot(edge, edge);
    edge_ = scaled(edge, constant<T>(1.0) / sqrt(r2));
    return r2;
  }
  void join_light(const WalkVertex<T>& y, const T& r2) {
    visitor_.vertex(topology_.camera_count());
    visitor_.position(y.shape, y.at.p);
    const Vec3<T> wi = -edge_;
    visitor_.light_connect(y.event(wi, y.w));
    visitor_.joined(r2);
  }

  const Scene& scene_;
  const PathTopology& topology_;
  const Blocks& blocks_;
  Visitor& visitor_;
  Vec3<T> edge_;
  int next_block_ = 0;
};

/// Walks the path. `blocks(k)` gives block k as Vec3<T> (see PathCoordinates); each is asked for
/// once, in order. Where it exists, `blocks(k, x)` is asked for the free direction at the vertex x,
/// and `blocks.emitter_normal()` and `blocks.emitter_uv()` for what is at the emitter point.
///
/// A path with PathEnd::Environment and a light side has two blocks for the emitted ray, a point on
/// it and its direction along the light. No chart has such paths, but the strategies of
/// bidirectional path tracing do.
template <Scalar T, class Blocks, class Visitor>
void walk(const Scene& scene, const PathTopology& topology, const Blocks& blocks,
          Visitor& visitor) {
  if (topology.has_light_side())
    return TwoSidedWalk<T, Blocks, Visitor>(scene, topology, blocks, visitor).run();
  using std::sqrt;
  const Vec3<T> lens = begin_at_lens<T>(scene.camera(), topology, blocks, visitor);
  int next_block = topology.lens_block_count();
  Ray<T> ray = leave_sensor<T>(scene.camera(), blocks(next_block++), lens, visitor);
  for (int k = 0; k < topology.scatter_count; ++k) {
    const WalkVertex<T> x = arrive(scene, topology.vertices[static_cast<std::size_t>(k)], ray);
    const Interaction<T>& at = x.at;
    const Vec3<T>& wi = x.w;
    visitor.vertex(k);
    visitor.position(x.shape, at.p);
    const bool connects = topology.ends_in_connection() && k + 1 == topology.scatter_count;
    if (!connects) {
      ray.origin = at.p;
      if (x.vertex.delta) {
        ray.direction = delta_direction(x.bsdf, x.surface(), wi, x.vertex.scattering);
        visitor.delta(x.event(wi, ray.direction));
      } else {
        ray.direction = free_direction(blocks, next_block++, x);
        visitor.scatter(x.event(wi, ray.direction));
      }
      visitor.depart(ray, at.n_g);
      continue;
    }
    const Emitter& emitter = scene.emitters()[topology.emitter];
    if (const auto* parallel = std::get_if<DirectionalEmitter>(&emitter)) {
      const Vec3<T> wo = constant<T>(Vec3d(-parallel->direction));
      visitor.connect(x.event(wi, wo));
      visitor.directional_connection(*parallel);
      return;
    }
    const bool area = topology.end == PathEnd::AreaConnection;
    const Vec3<T> y = area ? Vec3<T>(blocks(next_block)) : constant<T>(position_of(emitter));
    const Vec3<T> edge = y - at.p;
    const T r2 = dot(edge, edge);
    const Vec3<T> wo = scaled(edge, constant<T>(1.0) / sqrt(r2));
    visitor.connect(x.event(wi, wo));
    if (area) {
      const auto& light = std::get<AreaEmitter>(emitter);
      const Shape& light_shape = scene.shapes()[light.shape];
      visitor.position(light_shape, y);
      visitor.area_connection(light, -dot(normal_at_end(blocks, light_shape, y), wo), r2);
      if (light.texture != nullptr)
        visitor.emission_texture(*light.texture, uv_at_end(blocks, light_shape, y));
    } else {
      visitor.point_connection(emitter, wo, r2);
    }
    return;
  }

  const Emitter& emitter = scene.emitters()[topology.emitter];
  if (topology.end == PathEnd::Environment) {
    visitor.environment(emitter, ray.direction);
    return;
  }
  if (const auto* blurred = std::get_if<BlurredAreaEmitter>(&emitter)) {
    visitor.blurred_hit(*blurred, ray);
    return;
  }
  const PathVertex& last = topology.vertices[topology.scatter_count];
  const Interaction<T> at = scene.interact(last.hit, ray);
  visitor.position(scene.shapes()[last.hit.shape], at.p);
  const Vec3<T> edge = at.p - ray.origin;
  const auto& light = std::get<AreaEmitter>(emitter);
  visitor.hit(light, -dot(at.n_g, ray.direction), dot(edge, edge));
  if (light.texture != nullptr) visitor.emission_texture(*light.texture, at.uv);
}

}  // namespace driftlight
