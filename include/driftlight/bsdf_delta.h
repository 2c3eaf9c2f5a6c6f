// SPDX-License-Identifier: Apache-2.0
/// The delta lobes of BSDFs, evaluated for every Scalar. Conventions as of bsdf.h.
#pragma once

#include "driftlight/bsdf_density.h"

namespace driftlight {

/// Direction that a delta lobe sends wi into; non-finite for transmission under total reflection.
template <Scalar T>
Vec3<T> delta_direction(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                        Scattering scattering);

/// Weight of that direction: R for reflection, (1 - R) (eta_i / eta_t)^2 for transmission.
template <Scalar T>
ScaledColor<T> eval_delta(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                          Scattering scattering);

// ---------------------------------------------------------------------------------------------

namespace detail {

/// F and 1 - F of an interface, passed from the side where n . wi has this sign.
template <Scalar T>
T interface_reflectance(double eta, const T& cos_i) {
  using std::abs;
  return fresnel_dielectric(T(abs(cos_i)), value(cos_i) > 0.0 ? eta : 1.0 / eta);
}

template <Scalar T>
ScaledColor<T> eval_delta_lobe(const Conductor& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                               Scattering scattering) {
  const T cos_i = dot(at.n, wi);
  if (scattering == Scattering::Transmission || value(cos_i) <= 0.0) return ScaledColor<T>::zero();
  return {constant<T>(0.0),
          fresnel_conductor(cos_i, b.eta, b.k) * b.specular_reflectance.eval(at.uv)};
}

template <Scalar T>
ScaledColor<T> eval_delta_lobe(const Dielectric& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                               Scattering scattering) {
  using std::log;
  const T cos_i = dot(at.n, wi);
  const T fresnel = interface_reflectance(b.eta, cos_i);
  if (scattering == Scattering::Reflection)
    return {log(fresnel), b.specular_reflectance.eval(at.uv)};
  if (value(fresnel) >= 1.0) return ScaledColor<T>::zero();
  const double eta = value(cos_i) > 0.0 ? b.eta : 1.0 / b.eta;
  return {log(1.0 - fresnel) - 2.0 * std::log(eta), b.specular_transmittance.eval(at.uv)};
}

/// 2 R / (1 + R) and (1 - R) / (1 + R), the same from both sides
template <Scalar T>
ScaledColor<T> eval_delta_lobe(const ThinDielectric& b, const SurfacePoint<T>& at,
                               const Vec3<T>& wi, Scattering scattering) {
  using std::abs;
  using std::log;
  const T r = fresnel_dielectric(T(abs(dot(at.n, wi))), b.eta);
  if (scattering == Scattering::Reflection)
    return {log(2.0 * r / (1.0 + r)), b.specular_reflectance.eval(at.uv)};
  if (value(r) >= 1.0) return ScaledColor<T>::zero();
  return {log((1.0 - r) / (1.0 + r)), b.specular_transmittance.eval(at.uv)};
}

template <Scalar T>
ScaledColor<T> eval_delta_lobe(const Plastic& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                               Scattering scattering) {
  using std::log;
  const T cos_i = dot(at.n, wi);
  if (scattering == Scattering::Transmission || value(cos_i) <= 0.0) return ScaledColor<T>::zero();
  return {log(fresnel_dielectric(cos_i, b.eta)), b.specular_reflectance.eval(at.uv)};
}

template <Scalar T>
ScaledColor<T> eval_delta_lobe(const Mask& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                               Scattering scattering) {
  using std::exp;
  const Rgb<T> opacity = b.opacity.eval(at.uv);
  const bool passes = scattering == Scattering::Transmission;
  if (b.nested == nullptr || !has_delta(b.nested->bsdf, scattering)) {
    if (!passes) return ScaledColor<T>::zero();
    return {constant<T>(0.0), constant<T>(Rgbd{1, 1, 1}) - opacity};
  }
  const ScaledColor<T> f = eval_delta(b.nested->bsdf, at, wi, scattering);
  if (!passes) return {f.log_scale, opacity * f.color};
  Rgb<T> color;
  const T scale = exp(f.log_scale);
  for (int c = 0; c < 3; ++c) color[c] = 1.0 - opacity[c] + opacity[c] * scale * f.color[c];
  return {constant<T>(0.0), color};
}

/// The layer's own, and what a delta lobe under it reflects: both into the mirror direction.
template <Scalar T>
ScaledColor<T> eval_delta_lobe(const Coating& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                               Scattering scattering) {
  using std::exp;
  const T cos_i = dot(at.n, wi);
  if (scattering == Scattering::Transmission || value(cos_i) <= 0.0) return ScaledColor<T>::zero();
  const T t = coat_transmittance(b, cos_i);
  const Rgb<T> specular = b.specular_reflectance.eval(at.uv);
  Rgb<T> color;
  for (int c = 0; c < 3; ++c) color[c] = (1.0 - t) * specular[c];
  const ScaledColor<T> under =
      eval_delta(b.nested->bsdf, at, b.inner(at.n, wi, cos_i), Scattering::Reflection);
  if (value(under.color).maxCoeff() > 0.0) {
    const Rgb<T> attenuation = coat_attenuation(b, cos_i, cos_i);
    const T through = t * t * exp(under.log_scale);
    for (int c = 0; c < 3; ++c) color[c] += through * attenuation[c] * under.color[c];
  }
  return {constant<T>(0.0), color};
}

/// Both lobes go into one direction.
template <Scalar T>
ScaledColor<T> eval_delta_lobe(const Blend& b, const SurfacePoint<T>& at, const Vec3<T>& wi,
                               Scattering scattering) {
  return blended<T>(b.weight.eval(at.uv)[0], eval_delta(b.first->bsdf, at, wi, scattering),
                    eval_delta(b.second->bsdf, at, wi, scattering));
}

/// Those that have no delta lobe.
template <class B, Scalar T>
ScaledColor<T> eval_delta_lobe(const B&, const SurfacePoint<T>&, const Vec3<T>&, Scattering) {
  return ScaledColor<T>::zero();
}

}  // namespace detail

template <Scalar T>
Vec3<T> delta_direction(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                        Scattering scattering) {
  if (scattering == Scattering::Reflection) return reflect(wi, at.n);
  const double eta = delta_eta(bsdf);
  if (eta == 1.0) return -wi;
  return refract(wi, at.n, value(dot(at.n, wi)) > 0.0 ? eta : 1.0 / eta);
}

template <Scalar T>
ScaledColor<T> eval_delta(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& wi,
                          Scattering scattering) {
  return std::visit([&](const auto& b) { return detail::eval_delta_lobe(b, at, wi, scattering); },
                    bsdf);
}

}  // namespace driftlight
