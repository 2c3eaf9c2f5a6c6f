// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: what they need of a path, recorded by a walk in double.
#pragma once

#include <utility>

#include "driftlight/hand_relief.h"
#include "driftlight/linearization.h"
#include "driftlight/walk.h"

namespace driftlight::hand {

/// A scattering vertex. On the light side the path runs along the light: w_i toward the emitter.
struct Vertex {
  const Bsdf* bsdf;
  const Shape* shape;
  Vec3d p, n_g, n_s, wi, wo;
  Vec2d uv;
  Vec3d tangent;
  TangentField field;  ///< of the tangent; only if the shape is anisotropic
  double length;       ///< of the edge that arrives; negative where a displaced path runs backward
  double hit_cosine;   ///< n_g . v of that edge
  double cos_i, cos_o, io;
  Scattering scattering;
  bool delta;
  FactorPartials factor;
  SurfaceDifferential surface;
};

/// Records a path, with the partials of its factors.
template <class Rules>
struct Recorder : WalkVisitor<double> {
  const PathTopology& topology;
  Vec3d sensor_origin;
  bool want_gradient;
  std::array<Vertex, kMaxPathLength> vertices;
  int count = 0;             ///< of vertices; of those on the sensor's side where there is another
  Vec3d v0;                  ///< the coordinate of the first ray
  Vec3d departure;           ///< its direction
  Vec3d end;                 ///< where the path meets its emitter
  Vec3d last_v;              ///< the direction into the environment
  double connection_cosine;  ///< of the emitter's normal
  Rgbd radiance{1, 1, 1};    ///< of an environment
  Rgbd color{1, 1, 1};       ///< of the whole path
  FactorPartials emission;   ///< by uv, of a textured emitter
  // Of a light side.
  Vec3d start;    ///< where it begins
  Vec3d emitted;  ///< the direction there
  Vec3d normal;   ///< of an area emitter there

  Recorder(const PathTopology& of, const Vec3d& from, bool gradient)
      : topology(of), sensor_origin(from), want_gradient(gradient) {}

  /// Where the ray that meets vertex k starts.
  const Vec3d& origin(int k) const {
    return k == 0 ? sensor_origin : vertices[static_cast<std::size_t>(k - 1)].p;
  }

  void lens(const Camera&, const Vec3d& p) { sensor_origin = p; }
  void sensor(const Camera&, const Vec3d& v, const Vec3d&) { v0 = departure = v; }
  void depart_parallel(const Ray<double>& ray) {
    sensor_origin = ray.origin;
    departure = ray.direction;
  }
  void position(const Shape&, const Vec3d& p) { end = p; }
  void scatter(const ScatterEvent<double>& e) {
    Vertex& x = add(e, count, origin(count), false);
    ++count;
    if (!want_gradient) return;
    x.factor =
        Rules::scatter(e.bsdf, {e.surface(), e.wi, e.wo, x.cos_i, x.cos_o, x.io, e.scattering});
    color *= x.factor.color;
  }
  void connect(const ScatterEvent<double>& e) { scatter(e); }
  void delta(const ScatterEvent<double>& e) {
    Vertex& x = add(e, count, origin(count), true);
    ++count;
    if (!want_gradient) return;
    x.factor = Rules::delta(e.bsdf, x.cos_i, e.at.uv, e.scattering);
    color *= x.factor.color;
  }
  void hit(const AreaEmitter& emitter, const double&, const double&) { color *= emitter.radiance; }
  void blurred_hit(const BlurredAreaEmitter& emitter, const Ray<double>&) {
    color *= emitter.sharp().radiance;
  }
  void environment(const Emitter& emitter, const Vec3d& v) {
    last_v = v;
    const auto* map = std::get_if<EnvironmentMap>(&emitter);
    radiance = map != nullptr ? map->eval(v) : std::get<ConstantEnvironment>(emitter).radiance;
    color *= radiance;
  }
  void area_connection(const AreaEmitter& emitter, const double& cosine, const double&) {
    connection_cosine = cosine;
    color *= emitter.radiance;
  }
  void point_connection(const Emitter& emitter, const Vec3d&, const double&) {
    color *= intensity(emitter);
  }
  void directional_connection(const DirectionalEmitter& emitter) { color *= emitter.irradiance; }
  void emission_texture(const Texture& texture, const Vec2d& uv) {
    if (!want_gradient) return;
    Rules::add_texture(texture, uv, emission);
    color *= emission.color;
  }

  void leave_point(const Vec3d& y) { start = y; }
  void area_emission(const AreaEmitter& emitter, const Vec3d& n, const Vec3d& v) {
    normal = n;
    emitted = v;
    color *= emitter.radiance;
  }
  void point_emission(const Emitter& emitter, const Vec3d& v) {
    start = position_of(emitter);
    emitted = v;
    color *= intensity(emitter);
  }
  void directional_emission(const DirectionalEmitter& emitter, const Vec3d&) {
    color *= emitter.irradiance;
  }
  void vertex(int k) { index_ = k; }
  /// f has its directions the other way round.
  void light_scatter(const ScatterEvent<double>& e) {
    Vertex& x = add_light(e, false);
    if (!want_gradient) return;
    x.factor =
        Rules::scatter(e.bsdf, {e.surface(), e.wi, e.wo, x.cos_o, x.cos_i, x.io, e.scattering});
    std::swap(x.factor.cos_i, x.factor.cos_o);
    std::swap(x.factor.tangent_i, x.factor.tangent_o);
    color *= x.factor.color;
  }
  void light_connect(const ScatterEvent<double>& e) { light_scatter(e); }
  void light_delta(const ScatterEvent<double>& e) {
    Vertex& x = add_light(e, true);
    if (!want_gradient) return;
    x.factor = Rules::delta(e.bsdf, x.cos_i, e.at.uv, e.scattering);
    color *= x.factor.color;
  }

 private:
  static const Rgbd& intensity(const Emitter& emitter) {
    const auto* spot = std::get_if<SpotEmitter>(&emitter);
    return spot != nullptr ? spot->intensity() : std::get<PointEmitter>(emitter).intensity;
  }
  Vertex& add_light(const ScatterEvent<double>& e, bool is_delta) {
    const bool first = index_ + 1 == topology.scatter_count;
    const Vec3d& from = first ? start : vertices[static_cast<std::size_t>(index_) + 1].p;
    return add({e.bsdf, e.shape, e.at, e.wo, e.wi, e.scattering}, index_, from, is_delta);
  }
  Vertex& add(const ScatterEvent<double>& e, int k, const Vec3d& from, bool is_delta) {
    const auto primitive = topology.vertices[static_cast<std::size_t>(k)].hit.primitive;
    Vertex& x = vertices[static_cast<std::size_t>(k)];
    x.bsdf = &e.bsdf;
    x.shape = &e.shape;
    x.p = e.at.p;
    x.n_g = e.at.n_g;
    x.n_s = e.at.n_s;
    x.wi = e.wi;
    x.wo = e.wo;
    x.uv = e.at.uv;
    x.tangent = e.at.tangent;
    if (e.shape.anisotropic) x.field = tangent_field(e.shape.geometry, primitive);
    x.length = (from - x.p).dot(x.wi);
    x.hit_cosine = Rules::hit_cosine(e.shape.geometry, from, Vec3d(-x.wi), x.n_g);
    x.cos_i = driftlight::dot(e.at.n_s, e.wi);
    if (!is_delta) {
      x.cos_o = driftlight::dot(e.at.n_s, e.wo);
      x.io = driftlight::dot(e.wi, e.wo);
    }
    x.scattering = e.scattering;
    x.delta = is_delta;
    x.surface = differential(x, primitive);
    return x;
  }
  static SurfaceDifferential differential(const Vertex& x, std::uint32_t primitive) {
    if (const Relief* const relief = x.shape->relief.get())
      return relieved_surface<Rules>(*relief, std::get<TriangleMesh>(x.shape->geometry), primitive,
                                     x.p, x.uv, x.n_s);
    return std::visit(
        [&](const auto& shape) {
          return Rules::surface(shape, primitive, x.p, x.n_s, x.shape->textured);
        },
        x.shape->geometry);
  }

  int index_ = 0;
};

/// What both sweeps know of a recorded path.
template <class Rules>
class RecordedPath {
 protected:
  RecordedPath(const Scene& scene, const PathTopology& topology, const Chart& chart,
               const Recorder<Rules>& path, Linearization& result)
      : scene_(scene), topology_(topology), chart_(chart), path_(path), result_(result) {}

  const Vertex& vertex(int k) const { return path_.vertices[static_cast<std::size_t>(k)]; }
  bool is_connection(int k) const { return topology_.ends_in_connection() && k + 1 == path_.count; }
  const Emitter& emitter() const { return scene_.emitters()[topology_.emitter]; }
  const Shape& emitter_shape() const {
    return scene_.shapes()[std::get<AreaEmitter>(emitter()).shape];
  }
  const SpotEmitter* spot() const { return std::get_if<SpotEmitter>(&emitter()); }
  /// Null if the last ray does not go to one.
  const BlurredAreaEmitter* blurred() const { return std::get_if<BlurredAreaEmitter>(&emitter()); }
  /// The ray that leaves the last vertex.
  Ray<double> last_ray() const {
    return {path_.origin(path_.count),
            path_.count == 0 ? path_.departure : vertex(path_.count - 1).wo};
  }
  Vec3d connection_point() const {
    return topology_.end == PathEnd::AreaConnection ? path_.end : position_of(emitter());
  }
  /// dn / dy of the emitter's normal: this times dy.
  double emitter_curvature() const {
    const auto* sphere = std::get_if<Sphere>(&emitter_shape().geometry);
    if (sphere == nullptr) return 0.0;
    return (sphere->flip_normals ? -1.0 : 1.0) / sphere->radius;
  }

  /// The outward normal of an emitter at a point.
  static Vec3d surface_normal(const Geometry& geometry, std::uint32_t primitive, const Vec3d& p) {
    if (const auto* sphere = std::get_if<Sphere>(&geometry))
      return (p - sphere->center) / sphere->radius;
    if (const auto* disk = std::get_if<Disk>(&geometry)) return disk->u.cross(disk->v).normalized();
    if (const auto* cylinder = std::get_if<Cylinder>(&geometry))
      return cylinder->across(Vec3d(p - cylinder->base)) / cylinder->radius;
    return geometric_normal(std::get<TriangleMesh>(geometry), primitive);
  }

  // With a light side: the two ends of the joining edge.
  int last_sensor_vertex() const { return topology_.camera_count() - 1; }
  const Vertex& light_end() const { return vertex(topology_.camera_count()); }
  const Vec3d& sensor_end() const { return path_.origin(topology_.camera_count()); }

  const Scene& scene_;
  const PathTopology& topology_;
  const Chart& chart_;
  const Recorder<Rules>& path_;
  Linearization& result_;
};

}  // namespace driftlight::hand
