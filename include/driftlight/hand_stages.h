// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the stages (linearization.h). The differentials of hand_rules.h
/// forward, in all local columns at once, and through them the residuals, in the order of
/// ConstraintVisitor: those of scattering are of hand_residuals.h,
///   film    x = (right.v) / (2 a f), f = forward.v:
///           dx = (right - (right.v) forward / f) / (2 a f) . dv                           (H22)
///   lens    from the point l of a lens in focus at F also right.(l - o) / (2 a F):
///           dx += right / (2 a F) . dl;  its own residual is (l - o) / R                  (H42)
///   spot    r = w_o: with its share of (H18)
///   emission, of an area r = v - c n, c = n.v: (H20);  of a spot r = v;  the point by its own
///   residuals, on the disk across parallel light r = y / R                                (H26)
///   blurred lamp, y = u + t v at the ray's nearest point, widths fixed:
///           dy = du + t dv + v dt, dt as of BlurredAreaEmitter::approach_differential     (H28)
/// The two directions of the joining edge, w_o = w and w_i = -w, have dw of (H18) with dx and dy of
/// both its ends.
#pragma once

#include "driftlight/hand_residuals.h"

namespace driftlight::hand {

template <class Rules>
class StageSweep : RecordedPath<Rules> {
  using Base = RecordedPath<Rules>;
  using Base::chart_;
  using Base::is_connection;
  using Base::path_;
  using Base::result_;
  using Base::scene_;
  using Base::topology_;
  using Base::vertex;

 public:
  StageSweep(const Scene& scene, const PathTopology& topology, const Chart& chart,
             const Recorder<Rules>& path, Linearization& result)
      : Base(scene, topology, chart, path, result), rows_(result) {}

  /// Stages and residual rows.
  void stages() {
    result_.stage_count = 0;
    if (topology_.has_light_side()) return stages_of_both_sides();
    begin_at_sensor();
    for (int k = 0; k < path_.count; ++k) {
      const Vertex& x = vertex(k);
      const Arrival at = arrive(x);
      position(*x.shape, at.dx);
      if (is_connection(k)) {
        connection_rows(x, at);
        close(Stage::Kind::Terminal, topology_.end == PathEnd::AreaConnection);
        return;
      }
      leave(x, at);
    }
    end();
    close(Stage::Kind::Terminal, false);
  }

 private:
  /// Tangents of the ray under way: of the plane of the vertex it leaves (none at the sensor) and
  /// of its direction.
  struct Tangents {
    Vec3d xi_t = Vec3d::Zero();
    Vec3d xi_b = Vec3d::Zero();
    Vec3d omega_t = Vec3d::Zero();
    Vec3d omega_b = Vec3d::Zero();
  };
  /// The differentials of a vertex that the ray comes to; dP is that of (H44).
  struct Arrival {
    Columns dx = Columns::zero();
    Columns dwi = Columns::zero();
    Columns dn = Columns::zero();
    Columns dp = Columns::zero();
  };
  /// The next block, in the columns of u.
  Columns block_columns() const {
    Columns d = Columns::zero();
    d.set(columns_.u, chart_.block(block_).t);
    d.set(columns_.u + 1, chart_.block(block_).b);
    return d;
  }
  /// The ray leaves in the direction of the next block.
  void take_direction() {
    ray_.omega_t = chart_.block(block_).t;
    ray_.omega_b = chart_.block(block_).b;
    ++block_;
  }
  void set_plane(const Vec3d& n) {
    const TangentBasis plane = tangent_basis(n);
    ray_.xi_t = plane.t;
    ray_.xi_b = plane.b;
  }

  /// (H42): the point on the lens, if there is one; its differential from here on.
  Columns begin_at_lens() {
    if (!topology_.has_lens) return Columns::zero();
    rows_.add(2.0 / (3.0 * scene_.camera().lens_radius), block_columns());
    return begin_at_point();
  }

  void begin_at_sensor() {
    const Columns lens = begin_at_lens();
    film(block_columns(), lens);
    const Camera& camera = scene_.camera();
    if (topology_.has_lens) return depart_freely(camera.forward, lens);
    if (!camera.is_orthographic()) {
      close(Stage::Kind::Free, true);
      take_direction();
      return;
    }
    close(Stage::Kind::Point, true);
    ray_.xi_t = camera.origin_differential(path_.v0, chart_.block(block_).t);
    ray_.xi_b = camera.origin_differential(path_.v0, chart_.block(block_).b);
    ++block_;
  }

  Arrival arrive(const Vertex& x) const {
    Arrival at;
    at.dx = hit(-x.wi, x.n_g, x.hit_cosine, x.length);
    at.dwi.set(columns_.omega, -ray_.omega_t);
    at.dwi.set(columns_.omega + 1, -ray_.omega_b);
    at.dn = normal(x.surface, at.dx);
    if (x.shape->anisotropic) at.dp = cross(x.field.turn, at.dx) + x.field.spread * at.dx;
    return at;
  }

  /// The next block is a point, xi of the next stage; its differential there.
  Columns begin_at_point() {
    close(Stage::Kind::Point, true);
    ray_.xi_t = chart_.block(block_).t;
    ray_.xi_b = chart_.block(block_).b;
    ++block_;
    Columns d = Columns::zero();
    d.set(columns_.xi, ray_.xi_t);
    d.set(columns_.xi + 1, ray_.xi_b);
    return d;
  }
  /// The next block is the direction in which the ray leaves a point with this differential.
  void depart_freely(const Vec3d& normal, const Columns& d) {
    set_plane(normal);
    take_direction();
    Stage& stage = close(Stage::Kind::Free, true);
    stage.position = map(d, ray_.xi_t, ray_.xi_b);
  }

  /// Scattering, and the ray that goes on.
  void leave(const Vertex& x, const Arrival& at) {
    set_plane(x.n_g);
    if (x.delta) {
      const TangentBasis basis = tangent_basis(x.wo);
      ray_.omega_t = basis.t;
      ray_.omega_b = basis.b;
      const Columns dv = delta(x, at.dwi, at.dn);
      Stage& stage = close(Stage::Kind::Delta, false);
      stage.position = map(at.dx, ray_.xi_t, ray_.xi_b);
      stage.direction = map(dv, ray_.omega_t, ray_.omega_b);
    } else {
      residuals(x, at, block_columns());
      take_direction();
      Stage& stage = close(Stage::Kind::Free, true);
      stage.position = map(at.dx, ray_.xi_t, ray_.xi_b);
    }
  }

  // ---- With a light side ----

  void stages_of_both_sides() {
    Arrival x;
    if (path_.count > 0) {
      begin_at_sensor();
      for (int k = 0; k + 1 < path_.count; ++k) pass(k);
      x = arrive(vertex(path_.count - 1));
    } else {
      x.dx = begin_at_lens();
    }
    result_.sensor_stages = result_.stage_count;
    columns_ = kLightColumns;
    emission();
    for (int k = topology_.scatter_count - 1; k > topology_.camera_count(); --k) pass(k);
    const Arrival y = arrive(this->light_end());
    join(x, y);
    close(Stage::Kind::Terminal, false);
  }

  void pass(int k) {
    const Vertex& x = vertex(k);
    const Arrival at = arrive(x);
    position(*x.shape, at.dx);
    leave(x, at);
  }

  /// (H26)
  void emission() {
    ray_ = {};
    Columns dn = Columns::zero();
    Columns dy = Columns::zero();
    if (topology_.end != PathEnd::PointEmission) {
      dy = block_columns();
      if (topology_.end == PathEnd::AreaEmission)
        position(this->emitter_shape(), dy);
      else
        rows_.add(2.0 / (3.0 * scene_.radius()), dy);
      dy = begin_at_point();
    }
    if (topology_.end == PathEnd::DirectionalEmission) return;
    const Vec3d& v = path_.emitted;
    const Columns dv = block_columns();
    Vec3d normal = v;
    if (topology_.end == PathEnd::AreaEmission) {
      normal = path_.normal;
      dn = this->emitter_curvature() * dy;
      rows_.tangential(normal, v, normal.dot(v), dv, dn, 1.0);
    } else if (const SpotEmitter* light = this->spot()) {
      rows_.add(1.0 / (3.0 * light->width()), dv);
    }
    depart_freely(normal, dy);
  }

  /// Both ends of the joining edge, whose columns are those of both sides: (H18).
  void join(const Arrival& x, const Arrival& y) {
    const Vertex& at = this->light_end();
    if (path_.count == 0 && scene_.camera().is_orthographic()) {
      // dv of the coordinate: (I - v v^T) dx / (a |v / (forward.v)|) of what is across the rays.
      const Vec3d& v = path_.v0;
      const Vec3d& forward = scene_.camera().forward;
      const Columns across = y.dx - outer(forward, dot(forward, y.dx));
      film(scene_.camera().cosine(v) / scene_.camera().scale * (across - outer(v, dot(v, across))),
           Columns::zero());
      position(*at.shape, y.dx);
      residuals(at, y, Columns::zero());
      return;
    }
    const Vec3d w = -at.wo;
    const double r = (at.p - this->sensor_end()).norm();
    const Columns de = y.dx - x.dx;
    const Columns dw = (1.0 / r) * (de - outer(w, dot(w, de)));
    if (path_.count > 0) {
      const Vertex& from = vertex(path_.count - 1);
      position(*from.shape, x.dx);
      residuals(from, x, dw);
    } else {
      film(dw, x.dx);
    }
    position(*at.shape, y.dx);
    residuals(at, y, -1.0 * dw);
  }

  Stage& close(Stage::Kind kind, bool has_block) {
    Stage& stage = result_.stages[static_cast<std::size_t>(result_.stage_count++)];
    stage.kind = kind;
    stage.has_block = has_block;
    stage.rows_end = rows_.count();
    return stage;
  }
  Stage::Map map(const Columns& d, const Vec3d& t, const Vec3d& b) const {
    Stage::Map m;
    m.row(0) = dot(t, d).template segment<4>(columns_.xi).matrix();
    m.row(1) = dot(b, d).template segment<4>(columns_.xi).matrix();
    return m;
  }

  /// (H14) for the four columns of the incoming ray.
  Columns hit(const Vec3d& v, const Vec3d& n, double cosine, double length) const {
    Columns d = Columns::zero();
    d.set(columns_.xi, ray_.xi_t);
    d.set(columns_.xi + 1, ray_.xi_b);
    d.set(columns_.omega, length * ray_.omega_t);
    d.set(columns_.omega + 1, length * ray_.omega_b);
    return d - outer(v, dot(n, d) / cosine);
  }

  static Columns normal(const SurfaceDifferential& surface, const Columns& dx) {
    if (surface.interpolated)
      return outer(surface.a1, dot(surface.c1, dx)) + outer(surface.a2, dot(surface.c2, dx));
    if (surface.curvature == 0.0) return Columns::zero();
    if (!surface.straight.isZero(0.0))
      return surface.curvature * (dx - outer(surface.straight, dot(surface.straight, dx)));
    return surface.curvature * dx;
  }

  /// (H12), (H13)
  static Columns delta(const Vertex& x, const Columns& dwi, const Columns& dn) {
    const auto map = Rules::delta_map(*x.bsdf, x.cos_i, x.scattering);
    const LocalRow d_cos = dot(x.wi, dn) + dot(x.n_s, dwi);
    return map.normal_factor * dn + outer(x.n_s, map.n_factor * d_cos) + map.wi_factor * dwi;
  }

  /// (H22), (H42)
  void film(const Columns& dv, const Columns& lens) {
    const Camera& camera = scene_.camera();
    const Vec3d& v = path_.v0;
    const double f = camera.cosine(v);
    const double factor = std::sqrt(12.0) / 3.0;
    const Vec3d x = camera.right - camera.right.dot(v) / f * camera.forward;
    const Vec3d y = camera.up - camera.up.dot(v) / f * camera.forward;
    const double shift = f / camera.focus_depth;
    rows_.add(factor * 0.5 / (camera.half_width * f) *
              (dot(x, dv) + shift * dot(camera.right, lens)));
    rows_.add(-factor * 0.5 / (camera.half_height * f) *
              (dot(y, dv) + shift * dot(camera.up, lens)));
  }

  void position(const Shape& shape, const Columns& dx) {
    for (int i = 0; i < 3; ++i) {
      const Vec3d row = shape.extent.whitening.row(i) / 3.0;
      if (!row.isZero(0.0)) rows_.add(dot(row, dx));
    }
  }

  void residuals(const Vertex& x, const Arrival& at, const Columns& dwo) {
    rows_.scatter(x, {at.dwi, dwo, at.dn, at.dp});
  }

  /// w_o = e / r with e = y - x: (H18)
  void connection_rows(const Vertex& x, const Arrival& at) {
    if (topology_.end == PathEnd::DirectionalConnection) return residuals(x, at, Columns::zero());
    const double r = (this->connection_point() - x.p).norm();
    const bool area = topology_.end == PathEnd::AreaConnection;
    const Columns dy = area ? block_columns() : Columns::zero();
    const Columns de = dy - at.dx;
    const Columns dwo = (1.0 / r) * (de - outer(x.wo, dot(x.wo, de)));
    residuals(x, at, dwo);
    if (area) position(this->emitter_shape(), dy);
    if (const SpotEmitter* light = this->spot()) rows_.add(1.0 / (3.0 * light->width()), dwo);
  }

  /// The emitter that is hit, or the environment.
  void end() {
    if (topology_.end == PathEnd::Environment) {
      const auto* map = std::get_if<EnvironmentMap>(&this->emitter());
      if (map == nullptr) return;
      Columns dv = Columns::zero();
      dv.set(columns_.omega, ray_.omega_t);
      dv.set(columns_.omega + 1, ray_.omega_b);
      rows_.add(std::sqrt(map->precision(path_.last_v)) / 3.0, dv);
      return;
    }
    if (const BlurredAreaEmitter* lamp = this->blurred()) return blurred_end(*lamp);
    const Hit& hit_at = topology_.vertices[topology_.scatter_count].hit;
    const Shape& shape = scene_.shapes()[hit_at.shape];
    const auto [from, v] = this->last_ray();
    const double length = (path_.end - from).dot(v);
    const Vec3d n = this->surface_normal(shape.geometry, hit_at.primitive, path_.end);
    const double cosine = Rules::hit_cosine(shape.geometry, from, v, n);
    position(shape, hit(v, n, cosine, length));
  }

  /// (H28)
  void blurred_end(const BlurredAreaEmitter& lamp) {
    const Ray<double> ray = this->last_ray();
    const auto [t, t_u, t_v] = lamp.approach_differential(ray);
    Columns du = Columns::zero();
    du.set(columns_.xi, ray_.xi_t);
    du.set(columns_.xi + 1, ray_.xi_b);
    Columns dv = Columns::zero();
    dv.set(columns_.omega, ray_.omega_t);
    dv.set(columns_.omega + 1, ray_.omega_b);
    const Columns dy = du + t * dv + outer(ray.direction, dot(t_u, du) + dot(t_v, dv));
    const Vec3d variance = lamp.approach(ray).variance;
    for (int i = 0; i < 3; ++i)
      rows_.add(1.0 / (3.0 * std::sqrt(variance[i])) * dot(Vec3d(lamp.axes().row(i)), dy));
  }

  LocalColumns columns_ = kSensorColumns;
  Tangents ray_;
  int block_ = 0;  ///< the next
  ResidualRows rows_;
};

}  // namespace driftlight::hand
