// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the gradient, by one adjoint sweep in world space.
///
/// With v_bar, x_bar the derivatives of log f by the direction v_k and the position x_k of the ray
/// that leaves vertex k, and the partials f_. of its factor (H1), going backward:
///   v_bar += f_o n + f_m w_i;   block b of the gradient is -(t.v_bar, b.v_bar)           free
///   n_bar  = f_i w_i + f_o w_o,   w_bar = f_i n + f_m w_o
///   v_bar += f_po P;   n_bar += f_pn P,   w_bar += f_pi P                     anisotropic
///   P_bar  = f_pi w_i + f_po w_o + f_pn n + 2 f_p2 P
///   n_bar += p v_bar + q (n.v_bar) w_i,   w_bar += q (n.v_bar) n + r v_bar               delta
///                                                      (p, q, r) of HandRules::DeltaMap
///   x_bar  = (I - n v^T / n.v) (x_bar + (dn/dx)^T n_bar + (duv/dx)^T uv_bar + (dP/dx)^T P_bar)
///                                                                                        (H14)
///   transposed v_bar  = t x_bar - w_bar,   w_i = -v
///
/// With a light side the joining edge e = y - x comes first. Its direction w = w_o at x = x_(t-1)
/// (the sensor has v_0 = w) and -w_o at y = x_t, which looks along the light:
///   w_bar = v_bar of x - v_bar of y,   e_bar by (H18),   x_bar = -e_bar,   y_bar = e_bar;
/// from there each side has its own sweep. On the light side the cosines of f_s |n_s.w| are
/// exchanged, and there is the factor (H24) besides. The emitter is at the end of that sweep, with
/// x_bar the derivative by the point y and v_bar that by the emitted direction v:
///   area   both have their share of (H25)
/// A textured emitter's radiance has the partials f_u, f_v by its uv (H37); where it is hit
///   x_bar = (I - v n^T / n.v) (duv/dx)^T uv_bar,   v_bar = t x_bar,
/// and as a block the point y has them in its y_bar.
///   spot   v_bar += (H23) for w = -v, with the opposite sign.
/// On the sensor's side x_bar ends as the derivative by the point on a lens.
#pragma once

#include "driftlight/hand_path.h"

namespace driftlight::hand {

template <class Rules>
class GradientSweep : RecordedPath<Rules> {
  using Base = RecordedPath<Rules>;
  using Base::chart_;
  using Base::is_connection;
  using Base::path_;
  using Base::result_;
  using Base::scene_;
  using Base::topology_;
  using Base::vertex;

 public:
  GradientSweep(const Scene& scene, const PathTopology& topology, const Chart& chart,
                const Recorder<Rules>& path, Linearization& result)
      : Base(scene, topology, chart, path, result) {}

  /// grad U
  void gradient() {
    shares_ << kLuminance * path_.color / luminance(path_.color), 1.0;
    result_.gradient.resize(chart_.dimension());
    int block = chart_.block_count();
    Vec3d x_bar = Vec3d::Zero();
    Vec3d v_bar = Vec3d::Zero();
    if (topology_.end == PathEnd::Environment) v_bar = environment_adjoint();
    if (const BlurredAreaEmitter* lamp = this->blurred()) {
      const auto by = Rules::blurred(*lamp, this->last_ray());
      x_bar = by.by_origin;
      v_bar = by.by_direction;
    }
    if (topology_.end == PathEnd::Hit && emits_texture()) hit_texture(x_bar, v_bar);
    if (topology_.has_light_side()) {
      const Vec3d e_bar = joining_edge();
      light_side(e_bar, block);
      x_bar = -e_bar;
      if (path_.count == 0) return store_lens(x_bar);
    }
    for (int k = path_.count - 1; k >= 0; --k) {
      const Vertex& x = vertex(k);
      Adjoint a = factor(x);
      if (x.delta) {
        through(x, v_bar, a);
      } else {
        v_bar += a.wo;
        if (is_connection(k)) {
          const Vec3d e_bar = connection(x, v_bar, block);
          x_bar = -e_bar;
        } else if (!topology_.has_light_side() || k != this->last_sensor_vertex()) {
          store(--block, v_bar);
        }
      }
      arrive(x, a, x_bar, v_bar);
    }
    const Camera& camera = scene_.camera();
    if (camera.is_orthographic()) v_bar = Rules::parallel_camera(camera, path_.v0, x_bar);
    store(topology_.lens_block_count(), v_bar + Rules::camera(camera, path_.v0));
    store_lens(x_bar);
  }

 private:
  double fold(const FactorPartials::Lanes& partial) const { return (shares_ * partial).sum(); }

  void store(int block, const Vec3d& bar) {
    result_.gradient[2 * block] = -chart_.block(block).t.dot(bar);
    result_.gradient[2 * block + 1] = -chart_.block(block).b.dot(bar);
  }

  void store_lens(const Vec3d& x_bar) {
    if (topology_.has_lens) store(0, x_bar);
  }

  Vec3d environment_adjoint() const {
    const auto* map = std::get_if<EnvironmentMap>(&this->emitter());
    if (map == nullptr) return Vec3d::Zero();
    return Rules::environment(*map, path_.last_v, path_.radiance, shares_.head<3>());
  }

  // ---- Textured emitters ----

  bool emits_texture() const {
    const auto* light = std::get_if<AreaEmitter>(&this->emitter());
    return light != nullptr && light->texture != nullptr;
  }
  /// By the point y.
  Vec3d texture_adjoint(std::uint32_t primitive, const Vec3d& y) const {
    const Geometry& geometry = this->emitter_shape().geometry;
    const Vec3d n = this->surface_normal(geometry, primitive, y);
    const auto surface = std::visit(
        [&](const auto& shape) { return Rules::surface(shape, primitive, y, n, true); }, geometry);
    return fold(path_.emission.u) * surface.u + fold(path_.emission.v) * surface.v;
  }
  /// By the last ray.
  void hit_texture(Vec3d& x_bar, Vec3d& v_bar) const {
    const Hit& hit = topology_.vertices[topology_.scatter_count].hit;
    const Geometry& geometry = this->emitter_shape().geometry;
    const Ray<double> ray = this->last_ray();
    const Vec3d n = this->surface_normal(geometry, hit.primitive, path_.end);
    const double cosine = Rules::hit_cosine(geometry, ray.origin, ray.direction, n);
    x_bar = Rules::hit_adjoint(ray.direction, n, cosine, texture_adjoint(hit.primitive, path_.end));
    v_bar = (path_.end - ray.origin).dot(ray.direction) * x_bar;
  }

  /// The derivative by the edge e = y - x, given that by w_o; stores that by y.
  Vec3d connection(const Vertex& x, Vec3d w_bar, int& block) {
    if (topology_.end == PathEnd::DirectionalConnection) return Vec3d::Zero();
    const double r = (this->connection_point() - x.p).norm();
    if (topology_.end == PathEnd::PointConnection) {
      if (const SpotEmitter* light = this->spot()) w_bar += Rules::spot(*light, x.wo);
      return Rules::connection_adjoint(x.wo, r, w_bar);
    }
    const Shape& light = this->emitter_shape();
    const Vec3d n = emitter_normal(light, path_.end);
    const double inverse = 1.0 / path_.connection_cosine;
    w_bar -= inverse * n;
    const Vec3d e_bar = Rules::connection_adjoint(x.wo, r, w_bar);
    Vec3d y_bar = e_bar;
    if (const auto* sphere = std::get_if<Sphere>(&light.geometry))
      y_bar -= (sphere->flip_normals ? -inverse : inverse) / sphere->radius * x.wo;
    if (emits_texture()) y_bar += texture_adjoint(0, path_.end);
    store(--block, y_bar);
    return e_bar;
  }

  /// Derivatives of log f by the normal and the two directions of a vertex, and by P.
  struct Adjoint {
    Vec3d n, wi, wo;
    Vec3d tangent = Vec3d::Zero();
  };

  /// By the vertex's own factor; that of a delta lobe knows no w_o.
  Adjoint factor(const Vertex& x) const {
    const FactorPartials& f = x.factor;
    const double f_i = fold(f.cos_i);
    const double f_o = x.delta ? 0.0 : fold(f.cos_o);
    const double f_m = x.delta ? 0.0 : fold(f.io);
    Adjoint a{f_i * x.wi + f_o * x.wo, f_i * x.n_s + f_m * x.wo, f_o * x.n_s + f_m * x.wi};
    if (!x.shape->anisotropic || x.delta) return a;
    const double by_wi = fold(f.tangent_i);
    const double by_wo = fold(f.tangent_o);
    const double by_n = fold(f.tangent_n);
    a.n += by_n * x.tangent;
    a.wi += by_wi * x.tangent;
    a.wo += by_wo * x.tangent;
    a.tangent = by_wi * x.wi + by_wo * x.wo + by_n * x.n_s + 2.0 * fold(f.tangent_2) * x.tangent;
    return a;
  }

  /// Through the direction that a delta lobe determines.
  void through(const Vertex& x, const Vec3d& v_bar, Adjoint& a) const {
    const auto map = Rules::delta_map(*x.bsdf, x.cos_i, x.scattering);
    const double along = map.n_factor * x.n_s.dot(v_bar);
    a.n += map.normal_factor * v_bar + along * x.wi;
    a.wi += along * x.n_s + map.wi_factor * v_bar;
  }

  /// From the vertex to the ray that arrives.
  void arrive(const Vertex& x, const Adjoint& a, Vec3d& x_bar, Vec3d& v_bar) const {
    const FactorPartials& f = x.factor;
    x_bar += x.surface.normal_adjoint(a.n);
    if (x.surface.textured) x_bar += fold(f.u) * x.surface.u + fold(f.v) * x.surface.v;
    if (x.shape->anisotropic) x_bar += Rules::tangent_adjoint(x.field, a.tangent);
    x_bar = Rules::hit_adjoint(Vec3d(-x.wi), x.n_g, x.hit_cosine, x_bar);
    v_bar = x.length * x_bar - a.wi;
  }

  // ---- Light side ----

  Adjoint light_factor(const Vertex& x) const {
    const auto g = Rules::light_factor(x.n_g, x.n_s, x.wi, x.wo, x.surface.interpolated, x.delta);
    Adjoint a = factor(x);
    a.n += g.n;
    a.wi += g.wi;
    a.wo += g.wo;
    return a;
  }

  /// The derivative by the joining edge.
  Vec3d joining_edge() const {
    if (path_.count == 0 && scene_.camera().is_orthographic()) return Vec3d::Zero();  // (H33)
    const Vertex& y = this->light_end();
    const Vec3d w = -y.wo;
    Vec3d w_bar = -light_factor(y).wo;
    if (path_.count > 0)
      w_bar += factor(vertex(path_.count - 1)).wo;
    else
      w_bar += Rules::camera(scene_.camera(), w);
    return Rules::connection_adjoint(w, (y.p - this->sensor_end()).norm(), w_bar);
  }

  void light_side(Vec3d x_bar, int& block) {
    Vec3d v_bar = Vec3d::Zero();
    for (int k = topology_.camera_count(); k < topology_.scatter_count; ++k) {
      const Vertex& x = vertex(k);
      Adjoint a = light_factor(x);
      v_bar += a.wo;
      if (x.delta)
        through(x, v_bar, a);
      else if (k > topology_.camera_count())
        store(--block, v_bar);
      arrive(x, a, x_bar, v_bar);
    }
    if (topology_.end == PathEnd::AreaEmission) {
      v_bar += Rules::log_cosine(path_.normal, path_.emitted);
      x_bar += this->emitter_curvature() * Rules::log_cosine(path_.emitted, path_.normal);
      if (emits_texture()) x_bar += texture_adjoint(0, path_.start);
    } else if (const SpotEmitter* light = this->spot()) {
      v_bar -= Rules::spot(*light, Vec3d(-path_.emitted));
    }
    if (topology_.end != PathEnd::DirectionalEmission) store(--block, v_bar);
    if (topology_.end != PathEnd::PointEmission) store(--block, x_bar);
  }

  FactorPartials::Lanes shares_;
};

}  // namespace driftlight::hand
