// SPDX-License-Identifier: Apache-2.0
/// The contribution f of a light path (DESIGN 1.1), written once for every Scalar.
///
/// In the measure of the path's coordinates (solid angle for free directions, area for points on an
/// emitter and on a lens),
///   f = W(v_0) prod_free f_s(x_k; -v_{k-1}, v_k) |n_k . v_k|
///              prod_delta {R_k or (1 - R_k) eta^-2}  L_end,
///   L_end = L_e                      free direction that hits an emitter or the environment
///           L_e g (1 - q / 10)^3     free direction to a BlurredAreaEmitter
///           L_e cos_y / r^2          connection to a point y on an area emitter
///           I / r^2                  connection to a point emitter
///           I falloff(-w) / r^2      connection to a spot emitter, in the direction w
///           E                        connection to a directional emitter.
///
/// With a light side (path.h) the coordinates are those of the camera-side directions up to
/// x_(t-1), the emitter point and directions along the light; x_(t-1) and x_t are joined by an edge
/// of length r, x_0 the sensor. From the light each dA d omega is another one: along a chain
/// through smooth surfaces n^2 cos d omega dA is conserved, as path_density.h says, n the
/// refractive index and the cosines |n_g . w|; a shading normal adds |n_s.w_i n_g.w_o / (n_s.w_o
/// n_g.w_i)| at each delta vertex; and d omega_(t-1) = |n_g.w_i|_t / r^2 dA_t. So with d omega dA
/// at the emitter in the place of d omega_a dA_a at the first free vertex a, and so on up to x_t,
/// the same f becomes
///   f = W(v_0) prod_camera {as above, x_(t-1) with w_o along the edge}  1 / r^2
///       prod_light free   f_s |n_s.w_o|  |n_g.w_i| / |n_g.w_o|
///       prod_light delta  {R_k or 1 - R_k}  |n_s.w_o n_g.w_i| / |n_s.w_i n_g.w_o|  L_begin,
///   L_begin = L_e cos_y      area emitter        I falloff      point or spot
///             E              directional emitter, per area across its light
///             L_e            environment, likewise and per solid angle,
/// w_i toward the sensor and w_o toward the light as everywhere. The eta^-2 of transmission is
/// gone: it is that of n^2 d omega. W(v_0) of t = 1 is at the direction of the joining edge.
///
/// A lens of radius R adds 1 / (pi R^2).
///
/// Factors with a large range enter as a sum of logarithms, colours (of order 1) as a product.
#pragma once

#include "driftlight/walk.h"

namespace driftlight {

/// f = exp(log_scale) * color; the target is its luminance and the potential U = -log target.
template <Scalar T>
class ContributionVisitor : public WalkVisitor<T> {
 public:
  void lens(const Camera& camera, const Vec3<T>&) {
    log_scale_ = log_scale_ + std::log(camera.lens_density());
  }
  void sensor(const Camera& camera, const Vec3<T>& v, const Vec3<T>&) {
    log_scale_ += camera.log_importance(v);
  }
  void scatter(const ScatterEvent<T>& e) { multiply(eval(e.bsdf, e.surface(), e.wi, e.wo)); }
  void connect(const ScatterEvent<T>& e) { scatter(e); }
  void delta(const ScatterEvent<T>& e) {
    multiply(eval_delta(e.bsdf, e.surface(), e.wi, e.scattering));
  }
  void hit(const AreaEmitter& emitter, const T& cosine, const T&) {
    color_ *= emits(cosine) ? constant<T>(emitter.radiance) : constant<T>(Rgbd{0, 0, 0});
  }
  void environment(const Emitter& emitter, const Vec3<T>& v) {
    if (const auto* map = std::get_if<EnvironmentMap>(&emitter))
      color_ *= map->eval(v);
    else
      color_ *= constant<T>(std::get<ConstantEnvironment>(emitter).radiance);
  }
  void blurred_hit(const BlurredAreaEmitter& emitter, const Ray<T>& ray) {
    const bool shines = emitter.shines({value(ray.origin), value(ray.direction)});
    color_ *= constant<T>(shines ? emitter.sharp().radiance : Rgbd{0, 0, 0});
    if (shines) log_scale_ += emitter.log_share(ray);
  }
  void area_connection(const AreaEmitter& emitter, const T& cosine, const T& r2) {
    using std::log;
    hit(emitter, cosine, r2);
    if (emits(cosine)) log_scale_ += log(cosine / r2);
  }
  void point_connection(const Emitter& emitter, const Vec3<T>& wo, const T& r2) {
    using std::log;
    log_scale_ -= log(r2);
    emit_from_point(emitter, Vec3<T>(-wo));
  }
  void directional_connection(const DirectionalEmitter& emitter) {
    color_ *= constant<T>(emitter.irradiance);
  }
  void emission_texture(const Texture& texture, const Vec2<T>& uv) { color_ *= texture.eval(uv); }

  void light_scatter(const ScatterEvent<T>& e) {
    using std::abs;
    using std::log;
    multiply(eval(e.bsdf, e.surface(), e.wi, e.wo));
    log_scale_ += log(abs(dot(e.at.n_g, e.wi) / dot(e.at.n_g, e.wo)));
  }
  void light_connect(const ScatterEvent<T>& e) { light_scatter(e); }
  /// R of the direction in which the light comes, which is that of the other side.
  void light_delta(const ScatterEvent<T>& e) {
    using std::abs;
    using std::log;
    const Vec3<T>& n_s = e.at.n_s;
    const Vec3<T>& n_g = e.at.n_g;
    const T cos_o = dot(n_s, e.wo);
    multiply(eval_delta(e.bsdf, e.surface(), e.wo, e.scattering));
    log_scale_ += log(abs(cos_o * dot(n_g, e.wi) / (dot(n_s, e.wi) * dot(n_g, e.wo))));
    if (e.scattering == Scattering::Reflection) return;
    const double eta = delta_eta(e.bsdf);
    log_scale_ = log_scale_ + 2.0 * std::log(value(cos_o) > 0.0 ? eta : 1.0 / eta);
  }
  void area_emission(const AreaEmitter& emitter, const Vec3<T>& normal, const Vec3<T>& v) {
    using std::log;
    const T cosine = dot(normal, v);
    hit(emitter, cosine, cosine);
    if (emits(cosine)) log_scale_ += log(cosine);
  }
  void point_emission(const Emitter& emitter, const Vec3<T>& v) { emit_from_point(emitter, v); }
  void directional_emission(const DirectionalEmitter& emitter, const Vec3<T>&) {
    directional_connection(emitter);
  }
  void environment_emission(const Emitter& emitter, const Vec3<T>&, const Vec3<T>& v) {
    environment(emitter, Vec3<T>(-v));
  }
  void joined(const T& r2) {
    using std::log;
    log_scale_ -= log(r2);
  }

  const T& log_scale() const { return log_scale_; }
  const Rgb<T>& color() const { return color_; }
  /// log of the luminance of f; -infinity for a path without contribution.
  T log_target() const {
    using std::log;
    return log_scale_ + log(luminance(color_));
  }

 private:
  /// One-sided emission. The branch cuts no derivative where f is positive.
  static bool emits(const T& cosine) { return value(cosine) > 0.0; }

  void emit_from_point(const Emitter& emitter, const Vec3<T>& v) {
    using std::log;
    if (const auto* spot = std::get_if<SpotEmitter>(&emitter)) {
      const T falloff = spot->falloff(v);
      const bool lit = value(falloff) > 0.0;
      color_ *= constant<T>(lit ? spot->intensity() : Rgbd{0, 0, 0});
      if (lit) log_scale_ += log(falloff);
      return;
    }
    color_ *= constant<T>(std::get<PointEmitter>(emitter).intensity);
  }
  void multiply(const ScaledColor<T>& factor) {
    log_scale_ += factor.log_scale;
    color_ *= factor.color;
  }

  T log_scale_ = constant<T>(0.0);
  Rgb<T> color_ = constant<T>(Rgbd{1, 1, 1});
};

/// The contribution as numbers.
struct Contribution {
  double log_target = 0;       ///< log luminance(f)
  Rgbd color = Rgbd::Zero();   ///< f / luminance(f); what a splat of unit target deposits
  Vec2d film = Vec2d::Zero();  ///< where it comes to the sensor, in film coordinates
};

/// Evaluates f. A path without contribution has log_target = -infinity; a degenerate one may be
/// NaN. Both are for the caller to count and to reject.
Contribution contribution(const Scene& scene, const PathTopology& topology,
                          const PathCoordinates& coordinates);

}  // namespace driftlight
