// SPDX-License-Identifier: Apache-2.0
/// The densities of BSDFs, evaluated for every Scalar. Conventions as of bsdf.h.
#pragma once

#include <algorithm>

#include "driftlight/bsdf_models.h"
#include "driftlight/fresnel.h"

namespace driftlight {

/// A non-negative colour exp(log_scale) * color: the factor with the large range as a logarithm.
/// color = 0 means no contribution.
template <Scalar T>
struct ScaledColor {
  T log_scale;
  Rgb<T> color;

  static ScaledColor zero() { return {constant<T>(0.0), constant<T>(Rgbd{0, 0, 0})}; }
};

/// f_s(wi, wo) |n . wo| of the BSDF's density, without its delta lobes.
/// Radiance is transported: transmission carries the factor (eta_i / eta_t)^2.
template <Scalar T>
ScaledColor<T> eval(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& wo);

// ---------------------------------------------------------------------------------------------

namespace detail {

/// Smith's G, separable.
template <Scalar T>
T shadowing(const Microfacets& m, const SurfacePoint<T>& at, const Vec3<T>& wi, const T& cos_i,
            const Vec3<T>& wo, const T& cos_o) {
  return m.g1(m.grazing(at, wi, cos_i)) * m.g1(m.grazing(at, wo, cos_o));
}

/// log D of h = wi + e wo, from the square of its cosine.
template <Scalar T>
T log_facets(const Microfacets& m, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo,
             double e, const T& cos_h2) {
  const Vec3<T> h = {wi.x() + e * wo.x(), wi.y() + e * wo.y(), wi.z() + e * wo.z()};
  return m.log_d(cos_h2, m.steepness(at, h, cos_h2));
}

/// F D G / (4 cos_i): |h| of h = wi + wo gives cos(wi, h) = |h| / 2 and cos(n, h) = n.h / |h|.
template <Scalar T>
ScaledColor<T> eval_bsdf(const RoughConductor& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  using std::log;
  using std::sqrt;
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return ScaledColor<T>::zero();
  const T h2 = 2.0 + 2.0 * dot(wi, wo);
  const T cos_h2 = sqr(cos_i + cos_o) / h2;
  const Microfacets& m = b.microfacets;
  const T g = shadowing(m, at, wi, cos_i, wo, cos_o);
  const Rgb<T> fresnel = fresnel_conductor(T(0.5 * sqrt(h2)), b.eta, b.k);
  return {log_facets(m, at, wi, wo, 1.0, cos_h2) + log(g / (4.0 * cos_i)),
          fresnel * b.specular_reflectance.eval(at.uv)};
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Diffuse& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  using std::log;
  const T cos_o = dot(at.n, wo);
  if (value(dot(at.n, wi)) <= 0.0 || value(cos_o) <= 0.0) return ScaledColor<T>::zero();
  return {log(cos_o) - std::log(kPi), b.reflectance.eval(at.uv)};
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Conductor&, const SurfacePoint<T>&, const Vec3<T>&, const Vec3<T>&) {
  return ScaledColor<T>::zero();
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Dielectric&, const SurfacePoint<T>&, const Vec3<T>&,
                         const Vec3<T>&) {
  return ScaledColor<T>::zero();
}

/// With the (unnormalised) half vector h = wi + e wo, e = 1 for reflection and the index beyond
/// over the index on the side of wi for transmission:
///   reflection    F D G / (4 |cos_i|)
///   transmission  (1 - F) D G |wi.h wo.h| / (|cos_i| (wi.h + e wo.h)^2)
/// per unit half vector; e^2 of Walter et al. and the 1 / e^2 of radiance cancel, and so do the
/// lengths of h.
template <Scalar T>
ScaledColor<T> eval_bsdf(const RoughDielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  using std::abs;
  using std::log;
  using std::sqrt;
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) == 0.0 || value(cos_o) == 0.0) return ScaledColor<T>::zero();
  const bool reflection = (value(cos_i) > 0.0) == (value(cos_o) > 0.0);
  const double eta = value(cos_i) > 0.0 ? b.eta : 1.0 / b.eta;
  const double e = reflection ? 1.0 : eta;
  const T io = dot(wi, wo);
  const T h2 = (1.0 + e * e) + (2.0 * e) * io;
  const T ih = 1.0 + e * io;
  const T oh = io + e;
  const T cos_h2 = sqr(cos_i + e * cos_o) / h2;
  // A facet must be seen from the side on which the macroscopic surface is.
  const double h_side = value(cos_i) + e * value(cos_o);
  if (value(ih) * h_side * value(cos_i) <= 0.0 || value(oh) * h_side * value(cos_o) <= 0.0)
    return ScaledColor<T>::zero();
  const Microfacets& m = b.microfacets;
  const T g = shadowing(m, at, wi, cos_i, wo, cos_o);
  // Not a quotient: that of Jets is rounded in another way, which total reflection amplifies.
  const T fresnel = fresnel_dielectric(T(abs(ih) * (1.0 / sqrt(h2))), eta);
  const T log_dg = log_facets(m, at, wi, wo, e, cos_h2) + log(g / abs(cos_i));
  if (reflection) {
    return {log_dg + log(0.25 * fresnel), b.specular_reflectance.eval(at.uv)};
  }
  if (value(fresnel) >= 1.0) return ScaledColor<T>::zero();
  return {log_dg + log((1.0 - fresnel) * abs(ih * oh) / sqr(ih + e * oh)),
          b.specular_transmittance.eval(at.uv)};
}

/// (n + 2) / (2 pi) max(0, wo . mirror)^n
template <Scalar T>
T phong_lobe(const Phong& b, const T& cos_mirror) {
  using std::exp;
  using std::log;
  if (value(cos_mirror) <= 0.0) return constant<T>(0.0);
  return (b.exponent + 2.0) * (0.5 * kInvPi) * exp(b.exponent * log(cos_mirror));
}

/// E of Ward, by D = exp(-t) / (pi alpha_u alpha_v C^2), C = cos^2(h, n) = (cos_i + cos_o)^2 / h.h.
template <Scalar T>
T ward_lobe(const Ward& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  using std::exp;
  using std::sqrt;
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  const T h2 = 2.0 + 2.0 * dot(wi, wo);
  const T cos_h2 = sqr(cos_i + cos_o) / h2;
  const T d = exp(log_facets(b.microfacets(), at, wi, wo, 1.0, cos_h2));
  if (b.variant == Ward::Variant::Balanced) return d / h2;
  const T cosines = cos_i * cos_o;
  return 0.25 * d * sqr(cos_h2) / (b.variant == Ward::Variant::Ward ? T(sqrt(cosines)) : cosines);
}

/// Of two lobes that these reflectances are to be multiplied with, and cos_o.
template <Scalar T>
ScaledColor<T> eval_gloss(const Texture& specular, const T& lobe, const Texture& diffuse,
                          const T& cos_o, const Vec2<T>& uv) {
  using std::log;
  const Rgb<T> rho_s = specular.eval(uv);
  const Rgb<T> rho_d = diffuse.eval(uv);
  Rgb<T> color;
  for (int c = 0; c < 3; ++c) color[c] = rho_d[c] * kInvPi + rho_s[c] * lobe;
  return {log(cos_o), color};
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Phong& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  const T cos_o = dot(at.n, wo);
  if (value(dot(at.n, wi)) <= 0.0 || value(cos_o) <= 0.0) return ScaledColor<T>::zero();
  const T lobe = phong_lobe(b, dot(wo, reflect(wi, at.n)));
  return eval_gloss(b.specular_reflectance, lobe, b.diffuse_reflectance, cos_o, at.uv);
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Ward& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return ScaledColor<T>::zero();
  return eval_gloss(b.specular_reflectance, ward_lobe(b, at, wi, wo), b.diffuse_reflectance, cos_o,
                    at.uv);
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const ThinDielectric&, const SurfacePoint<T>&, const Vec3<T>&,
                         const Vec3<T>&) {
  return ScaledColor<T>::zero();
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Plastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  using std::log;
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return ScaledColor<T>::zero();
  const T t_i = 1.0 - fresnel_dielectric(cos_i, b.eta);
  const T t_o = 1.0 - fresnel_dielectric(cos_o, b.eta);
  return {log(cos_o * t_i * t_o * (kInvPi * b.base.inverse_eta2)), b.base.albedo(at.uv)};
}

/// Its two parts: D G / (4 cos_i) F and cos_o T_i T_o / (pi eta^2), which the two reflectances are
/// to be multiplied with.
template <Scalar T>
struct RoughPlasticParts {
  T specular, diffuse;
};
template <Scalar T>
RoughPlasticParts<T> rough_plastic_parts(const RoughPlastic& b, const SurfacePoint<T>& at,
                                         const Vec3<T>& wi, const Vec3<T>& wo) {
  using std::exp;
  using std::sqrt;
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  const T h2 = 2.0 + 2.0 * dot(wi, wo);
  const Microfacets& m = b.microfacets;
  const T g = shadowing(m, at, wi, cos_i, wo, cos_o);
  const T fresnel = fresnel_dielectric(T(0.5 * sqrt(h2)), b.eta);
  const T d = exp(log_facets(m, at, wi, wo, 1.0, T(sqr(cos_i + cos_o) / h2)));
  const T t = b.transmittance.eval(cos_i) * b.transmittance.eval(cos_o);
  return {d * g * fresnel / (4.0 * cos_i), cos_o * t * (kInvPi * b.base.inverse_eta2)};
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const RoughPlastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  if (value(dot(at.n, wi)) <= 0.0 || value(dot(at.n, wo)) <= 0.0) return ScaledColor<T>::zero();
  const RoughPlasticParts<T> part = rough_plastic_parts(b, at, wi, wo);
  const Rgb<T> specular = b.specular_reflectance.eval(at.uv);
  const Rgb<T> diffuse = b.base.albedo(at.uv);
  Rgb<T> color;
  for (int c = 0; c < 3; ++c) color[c] = specular[c] * part.specular + diffuse[c] * part.diffuse;
  return {constant<T>(0.0), color};
}

/// Luminances of the two lobes of a BSDF, up to a common factor.
template <Scalar T>
struct Lobes {
  T glossy, diffuse;

  bool any() const { return value(glossy) + value(diffuse) > 0.0; }
  T glossy_share() const { return glossy / (glossy + diffuse); }
};
template <Scalar T>
Lobes<T> lobes(const Phong& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  return {luminance(b.specular_reflectance.eval(at.uv)) *
              phong_lobe(b, T(2.0 * dot(at.n, wi) * dot(at.n, wo) - dot(wi, wo))),
          luminance(b.diffuse_reflectance.eval(at.uv)) * kInvPi};
}
template <Scalar T>
Lobes<T> lobes(const Ward& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  return {luminance(b.specular_reflectance.eval(at.uv)) * ward_lobe(b, at, wi, wo),
          luminance(b.diffuse_reflectance.eval(at.uv)) * kInvPi};
}
template <Scalar T>
Lobes<T> lobes(const RoughPlastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
               const Vec3<T>& wo) {
  const RoughPlasticParts<T> part = rough_plastic_parts(b, at, wi, wo);
  return {luminance(b.specular_reflectance.eval(at.uv)) * part.specular,
          luminance(b.base.albedo(at.uv)) * part.diffuse};
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Mask& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  if (b.nested == nullptr) return ScaledColor<T>::zero();
  const ScaledColor<T> f = eval(b.nested->bsdf, at, wi, wo);
  return {f.log_scale, b.opacity.eval(at.uv) * f.color};
}

/// T and A of a layer, from the cosines outside.
template <Scalar T>
T coat_transmittance(const Coating& b, const T& cosine) {
  return 1.0 - fresnel_dielectric(cosine, b.eta);
}
template <Scalar T>
Rgb<T> coat_attenuation(const Coating& b, const T& cos_i, const T& cos_o) {
  using std::exp;
  if ((b.absorption == 0.0).all()) return constant<T>(Rgbd{1, 1, 1});
  const T path = 1.0 / b.inner_cosine(cos_i) + 1.0 / b.inner_cosine(cos_o);
  Rgb<T> result;
  for (int c = 0; c < 3; ++c) result[c] = exp(path * -b.absorption[c]);
  return result;
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Coating& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  using std::log;
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return ScaledColor<T>::zero();
  const ScaledColor<T> f =
      eval(b.nested->bsdf, at, b.inner(at.n, wi, cos_i), b.inner(at.n, wo, cos_o));
  const T through = coat_transmittance(b, cos_i) * coat_transmittance(b, cos_o) * cos_o /
                    (b.inner_cosine(cos_o) * (b.eta * b.eta));
  return {f.log_scale + log(through), f.color * coat_attenuation(b, cos_i, cos_o)};
}

/// (1 - w) f_1 + w f_2, in units of the larger one.
template <Scalar T>
ScaledColor<T> blended(const T& w, const ScaledColor<T>& f1, const ScaledColor<T>& f2) {
  using std::exp;
  const bool has_first = value(f1.color).maxCoeff() > 0.0;
  const bool has_second = value(f2.color).maxCoeff() > 0.0;
  if (!has_first && !has_second) return ScaledColor<T>::zero();
  double unit = value(has_first ? f1.log_scale : f2.log_scale);
  if (has_second) unit = std::max(unit, value(f2.log_scale));
  ScaledColor<T> sum{constant<T>(unit), constant<T>(Rgbd{0, 0, 0})};
  const auto add = [&](const T& share, const ScaledColor<T>& f) {
    const T scale = share * exp(f.log_scale - unit);
    for (int c = 0; c < 3; ++c) sum.color[c] += scale * f.color[c];
  };
  if (has_first) add(T(1.0 - w), f1);
  if (has_second) add(w, f2);
  return sum;
}

template <Scalar T>
ScaledColor<T> eval_bsdf(const Blend& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                         const Vec3<T>& wo) {
  return blended<T>(b.weight.eval(at.uv)[0], eval(b.first->bsdf, at, wi, wo),
                    eval(b.second->bsdf, at, wi, wo));
}

/// The shares of the two in the luminance of the blend's density; 0 where that is 0.
template <Scalar T>
struct BlendShares {
  T first, second;
};
template <Scalar T>
BlendShares<T> blend_shares(const Blend& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                            const Vec3<T>& wo) {
  const T w = b.weight.eval(at.uv)[0];
  const ScaledColor<T> f1 = eval(b.first->bsdf, at, wi, wo);
  const ScaledColor<T> f2 = eval(b.second->bsdf, at, wi, wo);
  const ScaledColor<T> sum = blended<T>(w, f1, f2);
  const T all = luminance(sum.color);
  const auto share = [&](const T& weight, const ScaledColor<T>& f) {
    using std::exp;
    const T own = luminance(f.color);
    if (!(value(own) > 0.0 && value(all) > 0.0)) return constant<T>(0.0);
    return T(weight * own * exp(f.log_scale - sum.log_scale) / all);
  };
  return {share(T(1.0 - w), f1), share(w, f2)};
}

}  // namespace detail

template <Scalar T>
ScaledColor<T> eval(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& wo) {
  return std::visit([&](const auto& b) { return detail::eval_bsdf(b, at, wi, wo); }, bsdf);
}

}  // namespace driftlight
