// SPDX-License-Identifier: Apache-2.0
/// The constraints a path lives under (DESIGN 1.5), as residuals with their precision.
///
/// Every mechanism that makes the contribution vanish quickly is a residual r(X) of a few numbers
/// with a precision w = 1 / sigma^2; together they make
///   Q = 1/9 sum_k w_k J_k^T J_k + pi^-2 I,   J_k = d r_k / d delta                    (E63.13)
/// where q_k = 3 sigma_k is the "almost never exceeded" bound of [E63]. Precisions are taken at X,
/// not differentiated: they have the type of the scalar with one level of Jets stripped.
#pragma once

#include "driftlight/walk.h"

namespace driftlight {

/// Sink: void add(const T& residual, const Stripped<T>& precision).
template <Scalar T, class Sink>
class ConstraintVisitor : public WalkVisitor<T> {
 public:
  using S = Stripped<T>;

  explicit ConstraintVisitor(Sink& sink) : sink_(sink) {}

  /// Position on the lens, of standard deviation 1/2 of its radius along each axis.
  void lens(const Camera& camera, const Vec3<T>& p) {
    add(scaled(Vec3<T>(p - constant<T>(camera.origin)), constant<T>(1.0 / camera.lens_radius)),
        constant<S>(4.0));
  }

  /// Film position: uniform on the film, half side / sqrt(3); 1 / sqrt(12) in film coordinates.
  void sensor(const Camera& camera, const Vec3<T>& v, const Vec3<T>& lens) {
    const Vec2<T> film = camera.film_position(v, lens);
    const S precision = constant<S>(12.0);
    sink_.add(film.x(), precision);
    sink_.add(film.y(), precision);
  }

  /// Small object and small emitter: the position in the shape's principal axes against the
  /// covariance of the uniform distribution on the shape.
  void position(const Shape& shape, const Vec3<T>& p) {
    const S one = constant<S>(1.0);
    for (int i = 0; i < 3; ++i) {
      const Vec3d row = shape.extent.whitening.row(i);
      if (!row.isZero(0.0)) sink_.add(dot(row, p), one);
    }
  }

  void scatter(const ScatterEvent<T>& e) { constrain(e.bsdf, e, constant<S>(1.0)); }
  void connect(const ScatterEvent<T>& e) { scatter(e); }

  /// Environment map: the direction, by the map's own precision.
  void environment(const Emitter& emitter, const Vec3<T>& v) {
    const auto* map = std::get_if<EnvironmentMap>(&emitter);
    if (map == nullptr) return;
    add(v, map->precision(stripped(v)));
  }

  /// Blurred lamp: where the ray is nearest to it, by its variances there.
  void blurred_hit(const BlurredAreaEmitter& emitter, const Ray<T>& ray) {
    const auto [y, variance] = emitter.approach(ray);
    for (int i = 0; i < 3; ++i) sink_.add(y[i], S(1.0 / variance[i]));
  }

  /// Spot: the direction against the covariance of its cone.
  void point_connection(const Emitter& emitter, const Vec3<T>& wo, const T&) {
    if (const auto* spot = std::get_if<SpotEmitter>(&emitter))
      add(wo, constant<S>(1.0 / (spot->width() * spot->width())));
  }

  // From the light a vertex is what it is from the sensor with the two directions exchanged: then
  // f_s |n.w_i| is the factor of a diffuse lobe, and slopes of half vectors are the same.
  void light_scatter(const ScatterEvent<T>& e) {
    scatter({e.bsdf, e.shape, e.at, e.wo, e.wi, e.scattering});
  }
  void light_connect(const ScatterEvent<T>& e) { light_scatter(e); }

  /// Emission: tangential part of the direction; U = -log cos has sigma = cos.
  void area_emission(const AreaEmitter&, const Vec3<T>& normal, const Vec3<T>& v) {
    add_tangential(normal, v, constant<S>(1.0));
  }
  void point_emission(const Emitter& emitter, const Vec3<T>& v) {
    point_connection(emitter, v, constant<T>(1.0));
  }
  /// Position on the disk, of standard deviation 1/2 along each axis.
  void directional_emission(const DirectionalEmitter&, const Vec3<T>& offset) {
    add(offset, constant<S>(4.0));
  }

 private:
  static Vec3<S> stripped(const Vec3<T>& v) { return {strip(v.x()), strip(v.y()), strip(v.z())}; }
  static SurfacePoint<S> surface_of(const ScatterEvent<T>& e) {
    return {stripped(e.at.n_s), {strip(e.at.uv.x()), strip(e.at.uv.y())}, stripped(e.at.tangent)};
  }

  void add(const Vec3<T>& residual, const S& precision) {
    for (int i = 0; i < 3; ++i) sink_.add(residual[i], precision);
  }

  /// Slopes of the half vector h = wi + e wo, with sigma^2 of Microfacets::slope_variance. Of an
  /// isotropic distribution as a vector of the tangent plane, r = h / (h.n) - n, |r| = tan(h, n):
  /// free of any choice of tangents. Else along the tangent and across it.
  void add_slopes(const Microfacets& m, const ScatterEvent<T>& e, double eta,
                  const S& responsibility) {
    const Vec3<T>& n = e.at.n_s;
    const Vec3<T> h = {e.wi.x() + e.wo.x() * eta, e.wi.y() + e.wo.y() * eta,
                       e.wi.z() + e.wo.z() * eta};
    const T inverse = constant<T>(1.0) / dot(h, n);
    if (!m.is_isotropic()) {
      const TangentBasisOf<T> axes = tangent_axes(e.surface());
      const T r_u = dot(axes.t, h) * inverse;
      const T r_v = dot(axes.b, h) * inverse;
      const S u = strip(r_u) / m.alpha_u;
      const S v = strip(r_v) / m.alpha_v;
      const S t = u * u + v * v;
      sink_.add(r_u, S(responsibility / m.slope_variance(m.alpha_u, t)));
      sink_.add(r_v, S(responsibility / m.slope_variance(m.alpha_v, t)));
      return;
    }
    const Vec3<T> r = {h.x() * inverse - n.x(), h.y() * inverse - n.y(), h.z() * inverse - n.z()};
    const Vec3<S> s = stripped(r);
    const S t = dot(s, s) * (1.0 / (m.alpha_u * m.alpha_u));
    add(r, responsibility / m.slope_variance(m.alpha_u, t));
  }

  /// Tangential part of wo; U = -log cos has sigma = cos.
  void add_diffuse(const ScatterEvent<T>& e, const S& responsibility) {
    add_tangential(e.at.n_s, e.wo, responsibility);
  }
  void add_tangential(const Vec3<T>& n, const Vec3<T>& v, const S& responsibility) {
    const T cosine = dot(n, v);
    const Vec3<T> minus_cosine = scaled(n, T(-cosine));
    const S sigma = strip(cosine);
    add(v + minus_cosine, responsibility / (sigma * sigma));
  }

  // `share` is that of the BSDF in a blend.

  void constrain(const Bsdf& bsdf, const ScatterEvent<T>& e, const S& share) {
    std::visit([&](const auto& b) { constrain(b, e, share); }, bsdf);
  }
  void constrain(const Diffuse&, const ScatterEvent<T>& e, const S& share) {
    add_diffuse(e, share);
  }
  void constrain(const Conductor&, const ScatterEvent<T>&, const S&) {}
  void constrain(const Dielectric&, const ScatterEvent<T>&, const S&) {}
  void constrain(const RoughConductor& b, const ScatterEvent<T>& e, const S& share) {
    add_slopes(b.microfacets, e, 1.0, share);
  }
  void constrain(const RoughDielectric& b, const ScatterEvent<T>& e, const S& share) {
    const bool outside = value(dot(e.at.n_s, e.wi)) > 0.0;
    const double eta = e.scattering == Scattering::Reflection ? 1.0 : outside ? b.eta : 1.0 / b.eta;
    add_slopes(b.microfacets, e, eta, share);
  }

  void constrain(const ThinDielectric&, const ScatterEvent<T>&, const S&) {}
  void constrain(const Plastic&, const ScatterEvent<T>& e, const S& share) {
    add_diffuse(e, share);
  }
  /// Two lobes, each weighted by its share of f at X; `add_glossy` takes its weight.
  template <class B, class AddGlossy>
  void add_lobes(const B& b, const ScatterEvent<T>& e, const S& share,
                 const AddGlossy& add_glossy) {
    const auto lobes = detail::lobes<S>(b, surface_of(e), stripped(e.wi), stripped(e.wo));
    if (!lobes.any()) return;
    const S glossy = lobes.glossy_share();
    if (value(glossy) > 0.0) add_glossy(S(share * glossy));
    if (value(glossy) < 1.0) add_diffuse(e, S(share * (1.0 - glossy)));
  }
  /// The glossy lobe constrains wo to the mirror direction with sigma = 1 / sqrt(n).
  void constrain(const Phong& b, const ScatterEvent<T>& e, const S& share) {
    add_lobes(b, e, share, [&](const S& weight) {
      add(e.wo - reflect(e.wi, e.at.n_s), S(weight * b.exponent));
    });
  }
  void constrain(const Ward& b, const ScatterEvent<T>& e, const S& share) {
    add_lobes(b, e, share, [&](const S& weight) { add_slopes(b.microfacets(), e, 1.0, weight); });
  }
  void constrain(const RoughPlastic& b, const ScatterEvent<T>& e, const S& share) {
    add_lobes(b, e, share, [&](const S& weight) { add_slopes(b.microfacets, e, 1.0, weight); });
  }
  void constrain(const Mask& b, const ScatterEvent<T>& e, const S& share) {
    if (b.nested != nullptr) constrain(b.nested->bsdf, e, share);
  }
  /// As what is below is constrained, by directions within the layer.
  void constrain(const Coating& b, const ScatterEvent<T>& e, const S& share) {
    const Vec3<T>& n = e.at.n_s;
    const Vec3<T> wi = b.inner(n, e.wi, T(dot(n, e.wi)));
    const Vec3<T> wo = b.inner(n, e.wo, T(dot(n, e.wo)));
    constrain(b.nested->bsdf, {b.nested->bsdf, e.shape, e.at, wi, wo, e.scattering}, share);
  }
  void constrain(const Blend& b, const ScatterEvent<T>& e, const S& share) {
    const auto of = detail::blend_shares<S>(b, surface_of(e), stripped(e.wi), stripped(e.wo));
    if (value(of.first) > 0.0) constrain(b.first->bsdf, e, S(share * of.first));
    if (value(of.second) > 0.0) constrain(b.second->bsdf, e, S(share * of.second));
  }

  Sink& sink_;
};

}  // namespace driftlight
