// SPDX-License-Identifier: Apache-2.0
/// How BSDFs turn numbers into directions, and with which density, for every Scalar.
///
/// Which lobe takes a sample is a discrete choice: it is made by values, and derivatives are those
/// of the lobe taken.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "driftlight/bsdf.h"
#include "driftlight/warp.h"

namespace driftlight {

/// `sample`: wo from three numbers in [0, 1), of which the last chooses the lobe.
template <Scalar T>
std::optional<BsdfSampleOf<T>> warp(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                                    const Vec3<T>& u);

/// `pdf`, with derivatives.
template <Scalar T>
T pdf_of(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo);

/// `delta_probability`, with derivatives.
template <Scalar T>
T delta_probability_of(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering);

// ---------------------------------------------------------------------------------------------

namespace detail {

template <Scalar T>
using Warped = std::optional<BsdfSampleOf<T>>;

/// A sample that leaves on the wrong side is lost; its mass is missing from the pdf's integral.
template <Scalar T>
Warped<T> reflected(const Vec3<T>& wo, const Vec3<T>& wi, const Vec3<T>& n) {
  if (value(n).dot(value(wo)) * value(n).dot(value(wi)) <= 0.0) return std::nullopt;
  return BsdfSampleOf<T>{wo, Scattering::Reflection};
}

template <Scalar T>
Vec3<T> warp_diffuse(const Vec3<T>& n, const Vec3<T>& u) {
  return to_world<T>(square_to_cosine_hemisphere(u.x(), u.y()), n);
}

template <Scalar T>
Warped<T> warp_bsdf(const Diffuse&, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  if (value(at.n).dot(value(wi)) <= 0.0) return std::nullopt;
  return reflected<T>(warp_diffuse(at.n, u), wi, at.n);
}

template <Scalar T>
T pdf_bsdf(const Diffuse&, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  if (value(at.n).dot(value(wi)) <= 0.0) return constant<T>(0.0);
  const T cos_o = dot(at.n, wo);
  return value(cos_o) > 0.0 ? T(cos_o * kInvPi) : constant<T>(0.0);
}

template <Scalar T>
Warped<T> warp_bsdf(const Conductor&, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>&) {
  if (value(at.n).dot(value(wi)) <= 0.0) return std::nullopt;
  return BsdfSampleOf<T>{reflect(wi, at.n), Scattering::Reflection, true};
}

template <Scalar T>
T pdf_bsdf(const Conductor&, const SurfacePoint<T>&, const Vec3<T>&, const Vec3<T>&) {
  return constant<T>(0.0);
}

template <Scalar T>
Warped<T> warp_bsdf(const RoughConductor& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  if (value(at.n).dot(value(wi)) <= 0.0) return std::nullopt;
  const Vec3<T> h = b.microfacets.sample<T>(at, wi, u.x(), u.y());
  return reflected<T>(reflect(wi, h), wi, at.n);
}

/// p(wo) = p(h) / (4 wi.h)
template <Scalar T>
T mirrored_pdf(const Microfacets& m, const SurfacePoint<T>& at, const Vec3<T>& wi,
               const Vec3<T>& wo) {
  const Vec3<T> h = unit<T>(wi + wo);
  return m.pdf<T>(at, wi, h) / (4.0 * dot(wi, h));
}

template <Scalar T>
T pdf_bsdf(const RoughConductor& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
           const Vec3<T>& wo) {
  if (value(at.n).dot(value(wi)) <= 0.0 || value(at.n).dot(value(wo)) <= 0.0)
    return constant<T>(0.0);
  return mirrored_pdf<T>(b.microfacets, at, wi, wo);
}

template <Scalar T>
Warped<T> warp_bsdf(const Dielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  const double cos_i = value(at.n).dot(value(wi));
  if (value(u.z()) < interface_reflectance(b.eta, cos_i))
    return BsdfSampleOf<T>{reflect(wi, at.n), Scattering::Reflection, true};
  return BsdfSampleOf<T>{refract(wi, at.n, cos_i > 0.0 ? b.eta : 1.0 / b.eta),
                         Scattering::Transmission, true};
}

template <Scalar T>
T pdf_bsdf(const Dielectric&, const SurfacePoint<T>&, const Vec3<T>&, const Vec3<T>&) {
  return constant<T>(0.0);
}

/// The facet normal is drawn on the side of wi, then reflection with probability F.
template <Scalar T>
Warped<T> warp_bsdf(const RoughDielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  const double cos_i = value(at.n).dot(value(wi));
  if (cos_i == 0.0) return std::nullopt;
  const Vec3<T> n = cos_i > 0.0 ? at.n : Vec3<T>(-at.n);
  const double eta = cos_i > 0.0 ? b.eta : 1.0 / b.eta;
  const Vec3<T> h = b.microfacets.sample<T>({n, at.uv, at.tangent}, wi, u.x(), u.y());
  const double ih = value(wi).dot(value(h));
  if (ih <= 0.0) return std::nullopt;
  if (value(u.z()) < fresnel_dielectric(ih, eta)) return reflected<T>(reflect(wi, h), wi, n);
  const Vec3<T> wo = refract(wi, h, eta);
  if (value(n).dot(value(wo)) >= 0.0) return std::nullopt;
  return BsdfSampleOf<T>{wo, Scattering::Transmission};
}

/// reflection p(h) F / (4 wi.h); transmission p(h) (1 - F) e^2 |wo.h| / (wi.h + e wo.h)^2
template <Scalar T>
T pdf_bsdf(const RoughDielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
           const Vec3<T>& wo) {
  using std::abs;
  const double side = value(at.n).dot(value(wi)) > 0.0 ? 1.0 : -1.0;
  const Vec3<T> n = constant<T>(side) * at.n;
  const double cos_o = value(n).dot(value(wo));
  if (value(n).dot(value(wi)) == 0.0 || cos_o == 0.0) return constant<T>(0.0);
  const double eta = side > 0.0 ? b.eta : 1.0 / b.eta;
  const double e = cos_o > 0.0 ? 1.0 : eta;
  Vec3<T> h = unit<T>(wi + constant<T>(e) * wo);
  if (value(n).dot(value(h)) < 0.0) h = -h;
  const T ih = dot(wi, h);
  const T oh = dot(wo, h);
  if (value(ih) <= 0.0 || value(oh) * cos_o <= 0.0) return constant<T>(0.0);
  const T p = b.microfacets.pdf<T>({n, at.uv, at.tangent}, wi, h);
  const T fresnel = fresnel_dielectric(ih, eta);
  if (cos_o > 0.0) return p * fresnel / (4.0 * ih);
  const T denominator = ih + e * oh;
  return p * (1.0 - fresnel) * e * e * abs(oh) / (denominator * denominator);
}

/// Of Phong and Ward.
template <Scalar T, class B>
T specular_probability(const B& b, const Vec2<T>& uv) {
  const T specular = luminance(b.specular_reflectance.eval(uv));
  const T diffuse = luminance(b.diffuse_reflectance.eval(uv));
  const T sum = specular + diffuse;
  return value(sum) > 0.0 ? T(specular / sum) : constant<T>(0.0);
}

template <Scalar T>
Warped<T> warp_bsdf(const Phong& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  if (value(at.n).dot(value(wi)) <= 0.0) return std::nullopt;
  const Vec2d uv{value(at.uv.x()), value(at.uv.y())};
  if (value(u.z()) < specular_probability(b, uv)) {
    const Vec3<T> local = square_to_cosine_power(u.x(), u.y(), b.exponent);
    return reflected<T>(to_world<T>(local, reflect(wi, at.n)), wi, at.n);
  }
  return reflected<T>(warp_diffuse(at.n, u), wi, at.n);
}

/// (n + 1) / (2 pi) max(0, wo . mirror)^n
template <Scalar T>
T phong_pdf(const Phong& b, const T& cos_mirror) {
  const double norm = (b.exponent + 1.0) * (0.5 * kInvPi);
  if constexpr (ScalarTraits<T>::is_jet) {
    using std::exp;
    using std::log;
    if (value(cos_mirror) <= 0.0) return constant<T>(0.0);
    return norm * exp(b.exponent * log(cos_mirror));
  } else {
    return norm * std::pow(std::max(0.0, cos_mirror), b.exponent);
  }
}

template <Scalar T>
T pdf_bsdf(const Phong& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  const T cos_o = dot(at.n, wo);
  if (value(at.n).dot(value(wi)) <= 0.0 || value(cos_o) <= 0.0) return constant<T>(0.0);
  const T s = specular_probability(b, at.uv);
  const T lobe = phong_pdf(b, T(dot(wo, reflect(wi, at.n))));
  return s * lobe + (1.0 - s) * cos_o * kInvPi;
}

template <Scalar T>
Warped<T> warp_bsdf(const Ward& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& u) {
  if (value(at.n).dot(value(wi)) <= 0.0) return std::nullopt;
  const Vec2d uv{value(at.uv.x()), value(at.uv.y())};
  if (!(value(u.z()) < specular_probability(b, uv)))
    return reflected<T>(warp_diffuse(at.n, u), wi, at.n);
  const Vec3<T> h = b.microfacets().sample<T>(at, wi, u.x(), u.y());
  return reflected<T>(reflect(wi, h), wi, at.n);
}

template <Scalar T>
T pdf_bsdf(const Ward& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return constant<T>(0.0);
  const T s = specular_probability(b, at.uv);
  return s * mirrored_pdf<T>(b.microfacets(), at, wi, wo) + (1.0 - s) * cos_o * kInvPi;
}

/// With which the coat is taken: in proportion to F and T, and to what coat and base reflect.
template <Scalar T>
T coat_probability(const T& reflected, const Texture& coat, const Texture& base,
                   const Vec2<T>& uv) {
  const T specular = reflected * luminance(coat.eval(uv));
  const T diffuse = (1.0 - reflected) * luminance(base.eval(uv));
  const T sum = specular + diffuse;
  return value(sum) > 0.0 ? T(specular / sum) : constant<T>(0.0);
}
template <Scalar T>
T coat_probability(const Plastic& b, const T& cos_i, const Vec2<T>& uv) {
  return coat_probability<T>(fresnel_dielectric(cos_i, b.eta), b.specular_reflectance,
                             b.base.reflectance, uv);
}
template <Scalar T>
T coat_probability(const RoughPlastic& b, const T& cos_i, const Vec2<T>& uv) {
  return coat_probability<T>(1.0 - b.transmittance.eval(cos_i), b.specular_reflectance,
                             b.base.reflectance, uv);
}

/// The number u chooses the coat.
template <Scalar T, class B>
bool takes_coat(const B& b, const SurfacePoint<T>& at, double cos_i, const T& u) {
  const Vec2d uv{value(at.uv.x()), value(at.uv.y())};
  return value(u) < coat_probability<double>(b, cos_i, uv);
}

template <Scalar T>
Warped<T> warp_bsdf(const Plastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  const double cos_i = value(at.n).dot(value(wi));
  if (cos_i <= 0.0) return std::nullopt;
  if (takes_coat(b, at, cos_i, u.z()))
    return BsdfSampleOf<T>{reflect(wi, at.n), Scattering::Reflection, true};
  return reflected<T>(warp_diffuse(at.n, u), wi, at.n);
}

template <Scalar T>
T pdf_bsdf(const Plastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return constant<T>(0.0);
  return (1.0 - coat_probability<T>(b, cos_i, at.uv)) * cos_o * kInvPi;
}

template <Scalar T>
Warped<T> warp_bsdf(const RoughPlastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  const double cos_i = value(at.n).dot(value(wi));
  if (cos_i <= 0.0) return std::nullopt;
  if (!takes_coat(b, at, cos_i, u.z())) return reflected<T>(warp_diffuse(at.n, u), wi, at.n);
  const Vec3<T> h = b.microfacets.sample<T>(at, wi, u.x(), u.y());
  return reflected<T>(reflect(wi, h), wi, at.n);
}

template <Scalar T>
T pdf_bsdf(const RoughPlastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return constant<T>(0.0);
  const T coat = coat_probability<T>(b, cos_i, at.uv);
  return coat * mirrored_pdf<T>(b.microfacets, at, wi, wo) + (1.0 - coat) * cos_o * kInvPi;
}

/// F of one face; the pane reflects 2 F / (1 + F), with all that goes to and fro within.
template <Scalar T>
T face_reflectance(const ThinDielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi) {
  using std::abs;
  return fresnel_dielectric(T(abs(dot(at.n, wi))), b.eta);
}

template <Scalar T>
Warped<T> warp_bsdf(const ThinDielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  const double r = fresnel_dielectric(std::abs(value(at.n).dot(value(wi))), b.eta);
  if (value(u.z()) < 2.0 * r / (1.0 + r))
    return BsdfSampleOf<T>{reflect(wi, at.n), Scattering::Reflection, true};
  return BsdfSampleOf<T>{-wi, Scattering::Transmission, true};
}

template <Scalar T>
T pdf_bsdf(const ThinDielectric&, const SurfacePoint<T>&, const Vec3<T>&, const Vec3<T>&) {
  return constant<T>(0.0);
}

/// With which the nested BSDF is sampled.
template <Scalar T>
T nested_probability(const Mask& b, const Vec2<T>& uv) {
  const T p = luminance(b.opacity.eval(uv));
  if (value(p) <= 0.0) return constant<T>(0.0);
  return value(p) < 1.0 ? p : constant<T>(1.0);
}

template <Scalar T>
Warped<T> warp_bsdf(const Mask& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& u) {
  const double p = nested_probability<double>(b, {value(at.uv.x()), value(at.uv.y())});
  if (!(value(u.z()) < p)) return BsdfSampleOf<T>{-wi, Scattering::Transmission, true};
  if (b.nested == nullptr) return std::nullopt;
  return warp<T>(b.nested->bsdf, at, wi, Vec3<T>(u.x(), u.y(), constant<T>(value(u.z()) / p)));
}

template <Scalar T>
T pdf_bsdf(const Mask& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  if (b.nested == nullptr) return constant<T>(0.0);
  return nested_probability<T>(b, at.uv) * pdf_of<T>(b.nested->bsdf, at, wi, wo);
}

/// The layer reflects with probability F. What comes from below is refracted, or lost if the layer
/// holds it back.
template <Scalar T>
Warped<T> warp_bsdf(const Coating& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  using std::sqrt;
  const T cos_i = dot(at.n, wi);
  if (value(cos_i) <= 0.0) return std::nullopt;
  const double f = 1.0 - coat_transmittance(b, value(cos_i));
  const double choice = value(u.z());
  if (choice < f) return BsdfSampleOf<T>{reflect(wi, at.n), Scattering::Reflection, true};
  const Vec3<T> rest(u.x(), u.y(), constant<T>((choice - f) / (1.0 - f)));
  const auto below = warp<T>(b.nested->bsdf, at, b.inner(at.n, wi, cos_i), rest);
  if (!below) return std::nullopt;
  if (below->delta) return BsdfSampleOf<T>{reflect(wi, at.n), Scattering::Reflection, true};
  const T inner = dot(at.n, below->wo);
  const T cos2 = 1.0 - (1.0 - inner * inner) * (b.eta * b.eta);
  if (value(cos2) <= 0.0) return std::nullopt;
  const Vec3<T> wo =
      scaled(below->wo, constant<T>(b.eta)) + scaled(at.n, T(sqrt(cos2) - inner * b.eta));
  return reflected<T>(wo, wi, at.n);
}

/// d omega' / d omega = cos_o / (eta^2 cos_o')
template <Scalar T>
T pdf_bsdf(const Coating& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  const T cos_i = dot(at.n, wi);
  const T cos_o = dot(at.n, wo);
  if (value(cos_i) <= 0.0 || value(cos_o) <= 0.0) return constant<T>(0.0);
  const T below = pdf_of<T>(b.nested->bsdf, at, b.inner(at.n, wi, cos_i), b.inner(at.n, wo, cos_o));
  return coat_transmittance(b, cos_i) * below * cos_o / (b.inner_cosine(cos_o) * (b.eta * b.eta));
}

/// The second with probability w.
template <Scalar T>
Warped<T> warp_bsdf(const Blend& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                    const Vec3<T>& u) {
  const double w = b.weight.eval<double>({value(at.uv.x()), value(at.uv.y())})[0];
  const double choice = value(u.z());
  const bool second = choice < w;
  const double rest = second ? choice / w : (choice - w) / (1.0 - w);
  return warp<T>(second ? b.second->bsdf : b.first->bsdf, at, wi,
                 Vec3<T>(u.x(), u.y(), constant<T>(rest)));
}

template <Scalar T>
T pdf_bsdf(const Blend& b, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  const T w = b.weight.eval(at.uv)[0];
  return (1.0 - w) * pdf_of<T>(b.first->bsdf, at, wi, wo) +
         w * pdf_of<T>(b.second->bsdf, at, wi, wo);
}

template <Scalar T>
T probability_of_delta(const Conductor&, const SurfacePoint<T>&, const Vec3<T>&,
                       Scattering scattering) {
  return constant<T>(scattering == Scattering::Reflection ? 1.0 : 0.0);
}
template <Scalar T>
T probability_of_delta(const Dielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering) {
  const T reflection = interface_reflectance(b.eta, T(dot(at.n, wi)));
  return scattering == Scattering::Reflection ? reflection : T(1.0 - reflection);
}
template <Scalar T>
T probability_of_delta(const ThinDielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering) {
  const T r = face_reflectance(b, at, wi);
  return (scattering == Scattering::Reflection ? T(2.0 * r) : T(1.0 - r)) / (1.0 + r);
}
template <Scalar T>
T probability_of_delta(const Plastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering) {
  const T cos_i = dot(at.n, wi);
  if (scattering == Scattering::Transmission || value(cos_i) <= 0.0) return constant<T>(0.0);
  return coat_probability<T>(b, cos_i, at.uv);
}
template <Scalar T>
T probability_of_delta(const Mask& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering) {
  const T p = nested_probability<T>(b, at.uv);
  const T through = scattering == Scattering::Transmission ? T(1.0 - p) : constant<T>(0.0);
  if (b.nested == nullptr) return through;
  return through + p * delta_probability_of<T>(b.nested->bsdf, at, wi, scattering);
}
template <Scalar T>
T probability_of_delta(const Coating& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering) {
  const T cos_i = dot(at.n, wi);
  if (scattering == Scattering::Transmission || value(cos_i) <= 0.0) return constant<T>(0.0);
  const T t = coat_transmittance(b, cos_i);
  return 1.0 - t +
         t * delta_probability_of<T>(b.nested->bsdf, at, b.inner(at.n, wi, cos_i),
                                     Scattering::Reflection);
}
template <Scalar T>
T probability_of_delta(const Blend& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering) {
  const T w = b.weight.eval(at.uv)[0];
  return (1.0 - w) * delta_probability_of<T>(b.first->bsdf, at, wi, scattering) +
         w * delta_probability_of<T>(b.second->bsdf, at, wi, scattering);
}
/// Those that have no delta lobe.
template <Scalar T, class B>
T probability_of_delta(const B&, const SurfacePoint<T>&, const Vec3<T>&, Scattering) {
  return constant<T>(0.0);
}

}  // namespace detail

template <Scalar T>
std::optional<BsdfSampleOf<T>> warp(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                                    const Vec3<T>& u) {
  return std::visit([&](const auto& b) { return detail::warp_bsdf<T>(b, at, wi, u); }, bsdf);
}

template <Scalar T>
T pdf_of(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& wo) {
  return std::visit([&](const auto& b) { return detail::pdf_bsdf<T>(b, at, wi, wo); }, bsdf);
}

template <Scalar T>
T delta_probability_of(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                       Scattering scattering) {
  return std::visit(
      [&](const auto& b) { return detail::probability_of_delta(b, at, wi, scattering); }, bsdf);
}

}  // namespace driftlight
