// SPDX-License-Identifier: Apache-2.0
#include "driftlight/bsdf.h"

#include <boost/math/quadrature/gauss_kronrod.hpp>

#include "bsdf_warp.h"

namespace driftlight {
namespace {

/// 2 int F cos d cos
double diffuse_fresnel(double eta) {
  return boost::math::quadrature::gauss_kronrod<double, 31>::integrate(
      [&](double cosine) { return 2.0 * cosine * fresnel_dielectric(cosine, eta); }, 0.0, 1.0);
}

}  // namespace

Plastic::Plastic(double index, const Texture& diffuse, const Texture& specular, bool nonlinear)
    : eta(index), specular_reflectance(specular), base{diffuse, nonlinear} {
  // What comes out from within is what goes in from without, by eta^2: n^2 |cos| d omega is kept.
  base.inverse_eta2 = 1.0 / (eta * eta);
  base.internal_reflectance = 1.0 - (1.0 - diffuse_fresnel(eta)) * base.inverse_eta2;
}

RoughPlastic::RoughPlastic(const Microfacets& facets, double index, const Texture& diffuse,
                           const Texture& specular, bool nonlinear)
    : microfacets(facets),
      eta(index),
      specular_reflectance(specular),
      base{diffuse, nonlinear},
      transmittance(facets, index) {
  base.inverse_eta2 = 1.0 / (eta * eta);
  base.internal_reflectance = 1.0 - RoughTransmittance(facets, 1.0 / eta).diffuse();
}

bool is_delta(const Bsdf& bsdf) {
  if (const auto* blend = std::get_if<Blend>(&bsdf))
    return is_delta(blend->first->bsdf) && is_delta(blend->second->bsdf);
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested == nullptr || is_delta(mask->nested->bsdf);
  if (const auto* coating = std::get_if<Coating>(&bsdf)) return is_delta(coating->nested->bsdf);
  return std::holds_alternative<Conductor>(bsdf) || std::holds_alternative<Dielectric>(bsdf) ||
         std::holds_alternative<ThinDielectric>(bsdf);
}

bool has_delta(const Bsdf& bsdf, Scattering scattering) {
  if (const auto* blend = std::get_if<Blend>(&bsdf))
    return has_delta(blend->first->bsdf, scattering) || has_delta(blend->second->bsdf, scattering);
  if (std::holds_alternative<Dielectric>(bsdf) || std::holds_alternative<ThinDielectric>(bsdf))
    return true;
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return scattering == Scattering::Transmission ||
           (mask->nested != nullptr && has_delta(mask->nested->bsdf, scattering));
  const bool reflects = std::holds_alternative<Conductor>(bsdf) ||
                        std::holds_alternative<Plastic>(bsdf) ||
                        std::holds_alternative<Coating>(bsdf);
  return reflects && scattering == Scattering::Reflection;
}

bool is_transmissive(const Bsdf& bsdf) {
  if (const auto* blend = std::get_if<Blend>(&bsdf))
    return is_transmissive(blend->first->bsdf) || is_transmissive(blend->second->bsdf);
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested == nullptr || is_transmissive(mask->nested->bsdf);
  return std::holds_alternative<Dielectric>(bsdf) ||
         std::holds_alternative<RoughDielectric>(bsdf) ||
         std::holds_alternative<ThinDielectric>(bsdf);
}

bool is_diffuse(const Bsdf& bsdf) {
  if (const auto* blend = std::get_if<Blend>(&bsdf)) {
    const Bsdf& a = blend->first->bsdf;
    const Bsdf& b = blend->second->bsdf;
    return !is_delta(bsdf) && (is_delta(a) || is_diffuse(a)) && (is_delta(b) || is_diffuse(b));
  }
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested != nullptr && is_diffuse(mask->nested->bsdf);
  if (const auto* coating = std::get_if<Coating>(&bsdf)) return is_diffuse(coating->nested->bsdf);
  return std::holds_alternative<Diffuse>(bsdf) || std::holds_alternative<Plastic>(bsdf);
}

int lobe_count(const Bsdf& bsdf) {
  if (const auto* blend = std::get_if<Blend>(&bsdf))
    return lobe_count(blend->first->bsdf) + lobe_count(blend->second->bsdf);
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested == nullptr ? 0 : lobe_count(mask->nested->bsdf);
  if (const auto* coating = std::get_if<Coating>(&bsdf)) return lobe_count(coating->nested->bsdf);
  if (is_delta(bsdf)) return 0;
  // Black, which fills up blends, has no share in anything.
  const auto* diffuse = std::get_if<Diffuse>(&bsdf);
  if (diffuse != nullptr && diffuse->reflectance.is_constant() &&
      (diffuse->reflectance.color == 0.0).all())
    return 0;
  const bool has_two = std::holds_alternative<Phong>(bsdf) || std::holds_alternative<Ward>(bsdf) ||
                       std::holds_alternative<RoughPlastic>(bsdf);
  return has_two ? 2 : 1;
}

bool is_isotropic(const Bsdf& bsdf) {
  if (const auto* blend = std::get_if<Blend>(&bsdf))
    return is_isotropic(blend->first->bsdf) && is_isotropic(blend->second->bsdf);
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested == nullptr || is_isotropic(mask->nested->bsdf);
  if (const auto* coating = std::get_if<Coating>(&bsdf)) return is_isotropic(coating->nested->bsdf);
  if (const auto* metal = std::get_if<RoughConductor>(&bsdf))
    return metal->microfacets.is_isotropic();
  if (const auto* glass = std::get_if<RoughDielectric>(&bsdf))
    return glass->microfacets.is_isotropic();
  const auto* ward = std::get_if<Ward>(&bsdf);
  return ward == nullptr || ward->microfacets().is_isotropic();
}

double delta_eta(const Bsdf& bsdf) {
  if (const auto* blend = std::get_if<Blend>(&bsdf)) {
    const bool of_first = has_delta(blend->first->bsdf, Scattering::Transmission);
    return delta_eta(of_first ? blend->first->bsdf : blend->second->bsdf);
  }
  const auto* glass = std::get_if<Dielectric>(&bsdf);
  return glass != nullptr ? glass->eta : 1.0;
}

std::optional<BsdfSample> sample(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                                 const Vec3d& u) {
  return warp<double>(bsdf, at, wi, u);
}

double pdf(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi, const Vec3d& wo) {
  return pdf_of<double>(bsdf, at, wi, wo);
}

double delta_probability(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                         Scattering scattering) {
  return delta_probability_of<double>(bsdf, at, wi, scattering);
}

}  // namespace driftlight
