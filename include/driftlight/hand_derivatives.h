// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the sweep that chains the rules of hand_rules.h.
///
/// A walk in double records the vertices of the path. Then
/// - grad U, by one adjoint sweep in world space. With v_bar, x_bar the derivatives of log f by the
///   direction v_k and the position x_k of the ray that leaves vertex k, and the partials f_. of
///   its factor (H1), going backward:
///     v_bar += f_o n + f_m w_i;   block b of the gradient is -(t.v_bar, b.v_bar)     free
///     n_bar  = f_i w_i + f_o w_o,   w_bar = f_i n + f_m w_o
///     n_bar += p v_bar + q (n.v_bar) w_i,   w_bar += q (n.v_bar) n + r v_bar         delta: (p, q,
///     r)
///                                                                        of HandRules::DeltaMap
///     x_bar  = (I - n v^T / n.v) (x_bar + (dn/dx)^T n_bar + (duv/dx)^T uv_bar)       (H14)
///     transposed v_bar  = t x_bar - w_bar w_i = -v
/// - the stages (linearization.h): the same differentials forward, in six columns (xi, omega, u) at
///   once, and through them the residuals, in the order of ConstraintVisitor:
///     slopes  r = m - n, m = h / h.n, h = w_i + e w_o:
///             dr = (dh - m (n.dh)) / h.n - m (m.dn) - dn                                  (H19)
///     diffuse r = w_o - c_o n:  dr = dw_o - c_o dn - n dc_o                               (H20)
///     Phong   r = w_o - mirror: dr = dw_o - (2 c_i dn + 2 n dc_i - dw_i)                  (H21)
///     film    x = (right.v) / (2 a f), f = forward.v:  dx = (right - (right.v) forward / f) / (2 a
///     f) . dv
///                                                                                         (H22)
#pragma once

#include "driftlight/hand_rules.h"
#include "driftlight/linearization.h"
#include "driftlight/walk.h"

namespace driftlight {

namespace hand {

/// The differential of a vector, in all local columns.
struct Columns {
  LocalRow x, y, z;

  static Columns zero() { return {LocalRow::Zero(), LocalRow::Zero(), LocalRow::Zero()}; }
  void set(int column, const Vec3d& v) {
    x[column] = v.x();
    y[column] = v.y();
    z[column] = v.z();
  }
};

inline LocalRow dot(const Vec3d& a, const Columns& b) {
  return a.x() * b.x + a.y() * b.y + a.z() * b.z;
}
inline Columns outer(const Vec3d& a, const LocalRow& row) {
  return {a.x() * row, a.y() * row, a.z() * row};
}
inline Columns operator*(double k, const Columns& a) { return {k * a.x, k * a.y, k * a.z}; }
inline Columns operator+(const Columns& a, const Columns& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Columns operator-(const Columns& a, const Columns& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

/// First columns of the local variables.
inline constexpr int kXi = 0;
inline constexpr int kOmega = 2;
inline constexpr int kU = 4;

/// A scattering vertex.
struct Vertex {
  const Bsdf* bsdf;
  const Shape* shape;
  Vec3d p, n_g, n_s, wi, wo;
  Vec2d uv;
  double length;      ///< of the edge that arrives; negative where a displaced path runs backward
  double hit_cosine;  ///< n_g . v of that edge
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
  const Vec3d& sensor_origin;
  bool want_gradient;
  std::array<Vertex, kMaxPathLength> vertices;
  int count = 0;
  Vec3d v0;
  Vec3d end;                 ///< where the path meets its emitter
  Vec3d last_v;              ///< the direction into the environment
  double connection_cosine;  ///< of the emitter's normal
  Rgbd radiance{1, 1, 1};    ///< of an environment
  Rgbd color{1, 1, 1};       ///< of the whole path

  Recorder(const PathTopology& of, const Vec3d& from, bool gradient)
      : topology(of), sensor_origin(from), want_gradient(gradient) {}

  /// Where the ray that meets vertex k starts.
  const Vec3d& origin(int k) const {
    return k == 0 ? sensor_origin : vertices[static_cast<std::size_t>(k - 1)].p;
  }

  void sensor(const PerspectiveCamera&, const Vec3d& v) { v0 = v; }
  void position(const Shape&, const Vec3d& p) { end = p; }
  void scatter(const ScatterEvent<double>& e) {
    Vertex& x = add(e, false);
    x.cos_o = driftlight::dot(e.at.n_s, e.wo);
    x.io = driftlight::dot(e.wi, e.wo);
    if (!want_gradient) return;
    x.factor = Rules::scatter(e.bsdf, x.cos_i, x.cos_o, x.io, e.at.uv, e.scattering);
    color *= x.factor.color;
  }
  void connect(const ScatterEvent<double>& e) { scatter(e); }
  void delta(const ScatterEvent<double>& e) {
    Vertex& x = add(e, true);
    if (!want_gradient) return;
    x.factor = Rules::delta(e.bsdf, x.cos_i, e.at.uv, e.scattering);
    color *= x.factor.color;
  }
  void hit(const AreaEmitter& emitter, const double&, const double&) { color *= emitter.radiance; }
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
  void point_connection(const PointEmitter& emitter, const double&) { color *= emitter.intensity; }

 private:
  Vertex& add(const ScatterEvent<double>& e, bool is_delta) {
    const auto primitive = topology.vertices[static_cast<std::size_t>(count)].hit.primitive;
    const Vec3d& from = origin(count);
    Vertex& x = vertices[static_cast<std::size_t>(count++)];
    x.bsdf = &e.bsdf;
    x.shape = &e.shape;
    x.p = e.at.p;
    x.n_g = e.at.n_g;
    x.n_s = e.at.n_s;
    x.wi = e.wi;
    x.wo = e.wo;
    x.uv = e.at.uv;
    x.length = (from - x.p).dot(x.wi);
    x.hit_cosine = Rules::hit_cosine(e.shape.geometry, from, Vec3d(-x.wi), x.n_g);
    x.cos_i = driftlight::dot(e.at.n_s, e.wi);
    x.scattering = e.scattering;
    x.delta = is_delta;
    x.surface = std::visit(
        [&](const auto& shape) {
          return Rules::surface(shape, primitive, x.p, x.n_s, e.shape.textured);
        },
        e.shape.geometry);
    return x;
  }
};

/// Both sweeps over a recorded path.
template <class Rules>
class Sweep {
 public:
  Sweep(const Scene& scene, const PathTopology& topology, const Chart& chart,
        const Recorder<Rules>& path, Linearization& result)
      : scene_(scene), topology_(topology), chart_(chart), path_(path), result_(result) {}

  /// grad U
  void gradient() {
    shares_ << kLuminance * path_.color / luminance(path_.color), 1.0;
    result_.gradient.resize(chart_.dimension());
    int block = chart_.block_count();
    Vec3d x_bar = Vec3d::Zero();
    Vec3d v_bar = Vec3d::Zero();
    if (topology_.end == PathEnd::Environment) v_bar = environment_adjoint();
    for (int k = path_.count - 1; k >= 0; --k) {
      const Vertex& x = vertex(k);
      const FactorPartials& f = x.factor;
      const double f_i = fold(f.cos_i);
      const double f_o = x.delta ? 0.0 : fold(f.cos_o);
      const double f_m = x.delta ? 0.0 : fold(f.io);
      Vec3d n_bar = f_i * x.wi + f_o * x.wo;
      Vec3d w_bar = f_i * x.n_s + f_m * x.wo;
      if (x.delta) {
        const auto map = Rules::delta_map(*x.bsdf, x.cos_i, x.scattering);
        const double along = map.n_factor * x.n_s.dot(v_bar);
        n_bar += map.normal_factor * v_bar + along * x.wi;
        w_bar += along * x.n_s + map.wi_factor * v_bar;
      } else {
        v_bar += f_o * x.n_s + f_m * x.wi;
        if (is_connection(k)) {
          const Vec3d e_bar = connection(x, v_bar, block);
          x_bar = -e_bar;
        } else {
          store(--block, v_bar);
        }
      }
      x_bar += x.surface.normal_adjoint(n_bar);
      if (x.surface.textured) x_bar += fold(f.u) * x.surface.u + fold(f.v) * x.surface.v;
      x_bar = Rules::hit_adjoint(Vec3d(-x.wi), x.n_g, x.hit_cosine, x_bar);
      v_bar = x.length * x_bar - w_bar;
    }
    store(0, v_bar + Rules::camera(scene_.camera(), path_.v0));
  }

  /// Stages and residual rows.
  void stages() {
    result_.stage_count = 0;
    row_count_ = 0;
    int block = 0;
    sensor();
    close(Stage::Kind::Free, true);
    // Incoming ray: tangents of the last vertex's plane (none at the sensor) and of the direction.
    Vec3d xi_t = Vec3d::Zero();
    Vec3d xi_b = Vec3d::Zero();
    Vec3d omega_t = chart_.block(0).t;
    Vec3d omega_b = chart_.block(0).b;
    ++block;
    for (int k = 0; k < path_.count; ++k) {
      const Vertex& x = vertex(k);
      const Columns dx = hit(-x.wi, x.n_g, x.hit_cosine, x.length, xi_t, xi_b, omega_t, omega_b);
      Columns dwi = Columns::zero();
      dwi.set(kOmega, -omega_t);
      dwi.set(kOmega + 1, -omega_b);
      const Columns dn = normal(x.surface, dx);
      position(*x.shape, dx);
      if (is_connection(k)) {
        connection_rows(x, dx, dwi, dn, block);
        close(Stage::Kind::Terminal, topology_.end == PathEnd::AreaConnection);
        return;
      }
      const TangentBasis plane = tangent_basis(x.n_g);
      xi_t = plane.t;
      xi_b = plane.b;
      if (x.delta) {
        const TangentBasis basis = tangent_basis(x.wo);
        omega_t = basis.t;
        omega_b = basis.b;
        const Columns dv = delta(x, dwi, dn);
        Stage& stage = close(Stage::Kind::Delta, false);
        stage.position = map(dx, xi_t, xi_b);
        stage.direction = map(dv, omega_t, omega_b);
      } else {
        omega_t = chart_.block(block).t;
        omega_b = chart_.block(block).b;
        ++block;
        Columns dwo = Columns::zero();
        dwo.set(kU, omega_t);
        dwo.set(kU + 1, omega_b);
        residuals(x, dwi, dwo, dn);
        Stage& stage = close(Stage::Kind::Free, true);
        stage.position = map(dx, xi_t, xi_b);
      }
    }
    end(xi_t, xi_b, omega_t, omega_b);
    close(Stage::Kind::Terminal, false);
  }

 private:
  const Vertex& vertex(int k) const { return path_.vertices[static_cast<std::size_t>(k)]; }
  bool is_connection(int k) const { return topology_.ends_in_connection() && k + 1 == path_.count; }
  // ---- Gradient ----

  double fold(const FactorPartials::Lanes& partial) const { return (shares_ * partial).sum(); }

  void store(int block, const Vec3d& bar) {
    result_.gradient[2 * block] = -chart_.block(block).t.dot(bar);
    result_.gradient[2 * block + 1] = -chart_.block(block).b.dot(bar);
  }

  Vec3d environment_adjoint() const {
    const auto* map = std::get_if<EnvironmentMap>(&scene_.emitters()[topology_.emitter]);
    if (map == nullptr) return Vec3d::Zero();
    return Rules::environment(*map, path_.last_v, path_.radiance, shares_.head<3>());
  }

  const Shape& emitter_shape() const {
    const Emitter& emitter = scene_.emitters()[topology_.emitter];
    return scene_.shapes()[std::get<AreaEmitter>(emitter).shape];
  }
  Vec3d connection_point() const {
    if (topology_.end == PathEnd::AreaConnection) return path_.end;
    return std::get<PointEmitter>(scene_.emitters()[topology_.emitter]).position;
  }

  /// The derivative by the edge e = y - x, given that by w_o; stores that by y.
  Vec3d connection(const Vertex& x, Vec3d w_bar, int& block) {
    const double r = (connection_point() - x.p).norm();
    if (topology_.end == PathEnd::PointConnection) return Rules::connection_adjoint(x.wo, r, w_bar);
    const Shape& light = emitter_shape();
    const Vec3d n = emitter_normal(light, path_.end);
    const double inverse = 1.0 / path_.connection_cosine;
    w_bar -= inverse * n;
    const Vec3d e_bar = Rules::connection_adjoint(x.wo, r, w_bar);
    Vec3d y_bar = e_bar;
    if (const auto* sphere = std::get_if<Sphere>(&light.geometry))
      y_bar -= (sphere->flip_normals ? -inverse : inverse) / sphere->radius * x.wo;
    store(--block, y_bar);
    return e_bar;
  }

  // ---- Stages ----

  Stage& close(Stage::Kind kind, bool has_block) {
    Stage& stage = result_.stages[static_cast<std::size_t>(result_.stage_count++)];
    stage.kind = kind;
    stage.has_block = has_block;
    stage.rows_end = row_count_;
    return stage;
  }
  void add(const LocalRow& row) { result_.rows.row(row_count_++) = row; }
  /// `factor` is sqrt(w) / 3.
  void add(double factor, const Columns& dr) {
    add(factor * dr.x);
    add(factor * dr.y);
    add(factor * dr.z);
  }

  static Stage::Map map(const Columns& d, const Vec3d& t, const Vec3d& b) {
    Stage::Map m;
    m.row(0) = dot(t, d).template head<4>().matrix();
    m.row(1) = dot(b, d).template head<4>().matrix();
    return m;
  }

  /// (H14) for the four columns of the incoming ray.
  static Columns hit(const Vec3d& v, const Vec3d& n, double cosine, double length,
                     const Vec3d& xi_t, const Vec3d& xi_b, const Vec3d& omega_t,
                     const Vec3d& omega_b) {
    Columns d = Columns::zero();
    d.set(kXi, xi_t);
    d.set(kXi + 1, xi_b);
    d.set(kOmega, length * omega_t);
    d.set(kOmega + 1, length * omega_b);
    return d - outer(v, dot(n, d) / cosine);
  }

  static Columns normal(const SurfaceDifferential& surface, const Columns& dx) {
    if (surface.interpolated)
      return outer(surface.a1, dot(surface.c1, dx)) + outer(surface.a2, dot(surface.c2, dx));
    if (surface.curvature != 0.0) return surface.curvature * dx;
    return Columns::zero();
  }

  /// (H12), (H13)
  static Columns delta(const Vertex& x, const Columns& dwi, const Columns& dn) {
    const auto map = Rules::delta_map(*x.bsdf, x.cos_i, x.scattering);
    const LocalRow d_cos = dot(x.wi, dn) + dot(x.n_s, dwi);
    return map.normal_factor * dn + outer(x.n_s, map.n_factor * d_cos) + map.wi_factor * dwi;
  }

  /// (H22)
  void sensor() {
    const PerspectiveCamera& camera = scene_.camera();
    const Vec3d& v = path_.v0;
    const double f = camera.cosine(v);
    Columns dv = Columns::zero();
    dv.set(kU, chart_.block(0).t);
    dv.set(kU + 1, chart_.block(0).b);
    const double factor = std::sqrt(12.0) / 3.0;
    const Vec3d x = camera.right - camera.right.dot(v) / f * camera.forward;
    const Vec3d y = camera.up - camera.up.dot(v) / f * camera.forward;
    add(factor * 0.5 / (camera.half_width * f) * dot(x, dv));
    add(-factor * 0.5 / (camera.half_height * f) * dot(y, dv));
  }

  void position(const Shape& shape, const Columns& dx) {
    for (int i = 0; i < 3; ++i) {
      const Vec3d row = shape.extent.whitening.row(i) / 3.0;
      if (!row.isZero(0.0)) add(dot(row, dx));
    }
  }

  void residuals(const Vertex& x, const Columns& dwi, const Columns& dwo, const Columns& dn) {
    std::visit([&](const auto& bsdf) { constrain(bsdf, x, dwi, dwo, dn); }, *x.bsdf);
  }

  /// (H19)
  void slopes(const Microfacets& microfacets, double e, const Vertex& x, const Columns& dwi,
              const Columns& dwo, const Columns& dn) {
    const double hn = x.cos_i + e * x.cos_o;
    const Vec3d m = (x.wi + e * x.wo) / hn;
    const double s2 = (m - x.n_s).squaredNorm();
    const double factor = 1.0 / (3.0 * std::sqrt(microfacets.slope_variance(s2)));
    const Columns dh = dwi + e * dwo;
    const LocalRow along = dot(x.n_s, dh) / hn + dot(m, dn);
    add(factor, (1.0 / hn) * dh - outer(m, along) - dn);
  }
  /// (H20)
  void diffuse(const Vertex& x, const Columns& dwo, const Columns& dn, double share) {
    const double factor = std::sqrt(share) / (3.0 * std::abs(x.cos_o));
    const LocalRow d_cos = dot(x.n_s, dwo) + dot(x.wo, dn);
    add(factor, dwo - x.cos_o * dn - outer(x.n_s, d_cos));
  }

  void constrain(const Diffuse&, const Vertex& x, const Columns&, const Columns& dwo,
                 const Columns& dn) {
    diffuse(x, dwo, dn, 1.0);
  }
  void constrain(const Conductor&, const Vertex&, const Columns&, const Columns&, const Columns&) {}
  void constrain(const Dielectric&, const Vertex&, const Columns&, const Columns&, const Columns&) {
  }
  void constrain(const RoughConductor& b, const Vertex& x, const Columns& dwi, const Columns& dwo,
                 const Columns& dn) {
    slopes(b.microfacets, 1.0, x, dwi, dwo, dn);
  }
  void constrain(const RoughDielectric& b, const Vertex& x, const Columns& dwi, const Columns& dwo,
                 const Columns& dn) {
    const double eta = x.cos_i > 0.0 ? b.eta : 1.0 / b.eta;
    slopes(b.microfacets, x.scattering == Scattering::Reflection ? 1.0 : eta, x, dwi, dwo, dn);
  }
  /// (H21)
  void constrain(const Phong& b, const Vertex& x, const Columns& dwi, const Columns& dwo,
                 const Columns& dn) {
    const double lobe = detail::phong_lobe(b, 2.0 * x.cos_i * x.cos_o - x.io);
    const double glossy = luminance(b.specular_reflectance.eval(x.uv)) * lobe;
    const double matt = luminance(b.diffuse_reflectance.eval(x.uv)) * kInvPi;
    if (!(glossy + matt > 0.0)) return;
    const double share = glossy / (glossy + matt);
    if (share > 0.0) {
      const LocalRow d_cos = dot(x.wi, dn) + dot(x.n_s, dwi);
      const Columns mirror = 2.0 * x.cos_i * dn + outer(x.n_s, 2.0 * d_cos) - dwi;
      add(std::sqrt(share * b.exponent) / 3.0, dwo - mirror);
    }
    if (share < 1.0) diffuse(x, dwo, dn, 1.0 - share);
  }

  /// w_o = e / r with e = y - x: (H18)
  void connection_rows(const Vertex& x, const Columns& dx, const Columns& dwi, const Columns& dn,
                       int block) {
    const double r = (connection_point() - x.p).norm();
    Columns dy = Columns::zero();
    if (topology_.end == PathEnd::AreaConnection) {
      dy.set(kU, chart_.block(block).t);
      dy.set(kU + 1, chart_.block(block).b);
    }
    const Columns de = dy - dx;
    residuals(x, dwi, (1.0 / r) * (de - outer(x.wo, dot(x.wo, de))), dn);
    if (topology_.end == PathEnd::AreaConnection) position(emitter_shape(), dy);
  }

  /// The emitter that is hit, or the environment.
  void end(const Vec3d& xi_t, const Vec3d& xi_b, const Vec3d& omega_t, const Vec3d& omega_b) {
    if (topology_.end == PathEnd::Environment) {
      const auto* map = std::get_if<EnvironmentMap>(&scene_.emitters()[topology_.emitter]);
      if (map == nullptr) return;
      Columns dv = Columns::zero();
      dv.set(kOmega, omega_t);
      dv.set(kOmega + 1, omega_b);
      add(std::sqrt(environment_precision(*map)) / 3.0, dv);
      return;
    }
    const Hit& hit_at = topology_.vertices[topology_.scatter_count].hit;
    const Shape& shape = scene_.shapes()[hit_at.shape];
    const Vec3d& from = path_.origin(path_.count);
    const Vec3d& v = path_.count == 0 ? path_.v0 : vertex(path_.count - 1).wo;
    const double length = (path_.end - from).dot(v);
    const Vec3d n = surface_normal(shape.geometry, hit_at.primitive, path_.end);
    const double cosine = Rules::hit_cosine(shape.geometry, from, v, n);
    position(shape, hit(v, n, cosine, length, xi_t, xi_b, omega_t, omega_b));
  }

  static Vec3d surface_normal(const Geometry& geometry, std::uint32_t primitive, const Vec3d& p) {
    if (const auto* sphere = std::get_if<Sphere>(&geometry))
      return (p - sphere->center) / sphere->radius;
    if (const auto* disk = std::get_if<Disk>(&geometry)) return disk->u.cross(disk->v).normalized();
    return geometric_normal(std::get<TriangleMesh>(geometry), primitive);
  }

  /// |grad log L|^2 along the sphere, between 1 and a texel's.
  double environment_precision(const EnvironmentMap& map) const {
    const Vec3d& v = path_.last_v;
    const Vec3d slope = map.gradient(v).transpose() * kLuminance.matrix();
    const double light = luminance(path_.radiance);
    const double tangential2 = (slope - v.dot(slope) * v).squaredNorm() / (light * light);
    const double texel = map.texel_angle();
    if (!(tangential2 > 1.0)) return 1.0;
    return std::min(tangential2, 1.0 / (texel * texel));
  }

  const Scene& scene_;
  const PathTopology& topology_;
  const Chart& chart_;
  const Recorder<Rules>& path_;
  Linearization& result_;
  FactorPartials::Lanes shares_;
  int row_count_ = 0;
};

}  // namespace hand

/// linearize by the given rules.
template <class Rules>
void linearize_by_rules(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        const DerivativeRequest& request, Linearization& result) {
  hand::Recorder<Rules> path(topology, scene.camera().origin, request.gradient);
  const auto blocks = [&](int k) -> const Vec3d& { return chart.block(k).point; };
  walk<double>(scene, topology, blocks, path);
  hand::Sweep<Rules> sweep(scene, topology, chart, path, result);
  result.block_count = chart.block_count();
  result.stage_count = 0;
  result.gradient.resize(0);
  if (request.gradient) sweep.gradient();
  if (request.constraints) sweep.stages();
}

}  // namespace driftlight
