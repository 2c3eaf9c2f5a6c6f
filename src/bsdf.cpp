// SPDX-License-Identifier: Apache-2.0
#include "driftlight/bsdf.h"

#include <algorithm>
#include <cmath>

#include "driftlight/warp.h"

namespace driftlight {
namespace {

using Point = SurfacePoint<double>;

std::optional<BsdfSample> reflected(const Vec3d& wo, const Vec3d& wi, const Vec3d& n) {
  // A sample that leaves on the wrong side is lost; its mass is missing from the pdf's integral.
  if (n.dot(wo) * n.dot(wi) <= 0.0) return std::nullopt;
  return BsdfSample{wo, Scattering::Reflection};
}

std::optional<BsdfSample> sample_bsdf(const Diffuse&, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  if (at.n.dot(wi) <= 0.0) return std::nullopt;
  return reflected(to_world(square_to_cosine_hemisphere(u.x(), u.y()), at.n), wi, at.n);
}

double pdf_bsdf(const Diffuse&, const Point& at, const Vec3d& wi, const Vec3d& wo) {
  if (at.n.dot(wi) <= 0.0) return 0.0;
  return std::max(0.0, at.n.dot(wo)) * kInvPi;
}

std::optional<BsdfSample> sample_bsdf(const Conductor&, const Point& at, const Vec3d& wi,
                                      const Vec3d&) {
  if (at.n.dot(wi) <= 0.0) return std::nullopt;
  return BsdfSample{reflect(wi, at.n), Scattering::Reflection, true};
}

double pdf_bsdf(const Conductor&, const Point&, const Vec3d&, const Vec3d&) { return 0.0; }

std::optional<BsdfSample> sample_bsdf(const RoughConductor& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  if (at.n.dot(wi) <= 0.0) return std::nullopt;
  const Vec3d h = to_world(b.microfacets.sample(to_local(wi, at.n), u.x(), u.y()), at.n);
  return reflected(reflect(wi, h), wi, at.n);
}

/// p(wo) = p(h) / (4 wi.h)
double pdf_bsdf(const RoughConductor& b, const Point& at, const Vec3d& wi, const Vec3d& wo) {
  const double cos_i = at.n.dot(wi);
  if (cos_i <= 0.0 || at.n.dot(wo) <= 0.0) return 0.0;
  const Vec3d h = (wi + wo).normalized();
  const double ih = wi.dot(h);
  return b.microfacets.pdf(cos_i, at.n.dot(h), ih) / (4.0 * ih);
}

std::optional<BsdfSample> sample_bsdf(const Dielectric& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  const double cos_i = at.n.dot(wi);
  if (u.z() < detail::interface_reflectance(b.eta, cos_i))
    return BsdfSample{reflect(wi, at.n), Scattering::Reflection, true};
  const Vec3d wo = refract(wi, at.n, cos_i > 0.0 ? b.eta : 1.0 / b.eta);
  return BsdfSample{wo, Scattering::Transmission, true};
}

double pdf_bsdf(const Dielectric&, const Point&, const Vec3d&, const Vec3d&) { return 0.0; }

/// The facet normal is drawn on the side of wi, then reflection with probability F.
std::optional<BsdfSample> sample_bsdf(const RoughDielectric& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  const double cos_i = at.n.dot(wi);
  if (cos_i == 0.0) return std::nullopt;
  const Vec3d n = cos_i > 0.0 ? at.n : Vec3d(-at.n);
  const double eta = cos_i > 0.0 ? b.eta : 1.0 / b.eta;
  const Vec3d h = to_world(b.microfacets.sample(to_local(wi, n), u.x(), u.y()), n);
  const double ih = wi.dot(h);
  if (ih <= 0.0) return std::nullopt;
  if (u.z() < fresnel_dielectric(ih, eta)) return reflected(reflect(wi, h), wi, n);
  const Vec3d wo = refract(wi, h, eta);
  if (n.dot(wo) >= 0.0) return std::nullopt;
  return BsdfSample{wo, Scattering::Transmission};
}

/// reflection p(h) F / (4 wi.h); transmission p(h) (1 - F) e^2 |wo.h| / (wi.h + e wo.h)^2
double pdf_bsdf(const RoughDielectric& b, const Point& at, const Vec3d& wi, const Vec3d& wo) {
  const double side = at.n.dot(wi) > 0.0 ? 1.0 : -1.0;
  const double cos_i = side * at.n.dot(wi);
  const double cos_o = side * at.n.dot(wo);
  if (cos_i == 0.0 || cos_o == 0.0) return 0.0;
  const double eta = side > 0.0 ? b.eta : 1.0 / b.eta;
  const double e = cos_o > 0.0 ? 1.0 : eta;
  Vec3d h = (wi + e * wo).normalized();
  if (at.n.dot(h) * side < 0.0) h = -h;
  const double ih = wi.dot(h);
  const double oh = wo.dot(h);
  if (ih <= 0.0 || oh * cos_o <= 0.0) return 0.0;
  const double p = b.microfacets.pdf(cos_i, side * at.n.dot(h), ih);
  const double fresnel = fresnel_dielectric(ih, eta);
  if (cos_o > 0.0) return p * fresnel / (4.0 * ih);
  const double denominator = ih + e * oh;
  return p * (1.0 - fresnel) * e * e * std::abs(oh) / (denominator * denominator);
}

double specular_probability(const Phong& b, const Vec2d& uv) {
  const double specular = luminance(b.specular_reflectance.eval(uv));
  const double diffuse = luminance(b.diffuse_reflectance.eval(uv));
  return specular + diffuse > 0.0 ? specular / (specular + diffuse) : 0.0;
}

std::optional<BsdfSample> sample_bsdf(const Phong& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  if (at.n.dot(wi) <= 0.0) return std::nullopt;
  if (u.z() < specular_probability(b, at.uv)) {
    const Vec3d local = square_to_cosine_power(u.x(), u.y(), b.exponent);
    return reflected(to_world(local, reflect(wi, at.n)), wi, at.n);
  }
  return reflected(to_world(square_to_cosine_hemisphere(u.x(), u.y()), at.n), wi, at.n);
}

double pdf_bsdf(const Phong& b, const Point& at, const Vec3d& wi, const Vec3d& wo) {
  const double cos_o = at.n.dot(wo);
  if (at.n.dot(wi) <= 0.0 || cos_o <= 0.0) return 0.0;
  const double s = specular_probability(b, at.uv);
  const double cos_mirror = std::max(0.0, wo.dot(reflect(wi, at.n)));
  const double lobe = (b.exponent + 1.0) * (0.5 * kInvPi) * std::pow(cos_mirror, b.exponent);
  return s * lobe + (1.0 - s) * cos_o * kInvPi;
}

/// 2 int F cos d cos, by Simpson's rule.
double diffuse_fresnel(double eta) {
  constexpr int kSteps = 512;
  double sum = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double weight = i == 0 || i == kSteps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
    const double cosine = static_cast<double>(i) / kSteps;
    sum += weight * cosine * fresnel_dielectric(cosine, eta);
  }
  return 2.0 * sum / (3.0 * kSteps);
}

/// The coat is taken in proportion to T and F, and to what base and coat reflect.
double coat_probability(double reflected, const Texture& coat, const Texture& base,
                        const Vec2d& uv) {
  const double specular = reflected * luminance(coat.eval(uv));
  const double diffuse = (1.0 - reflected) * luminance(base.eval(uv));
  return specular + diffuse > 0.0 ? specular / (specular + diffuse) : 0.0;
}

double coat_probability(const Plastic& b, double cos_i, const Vec2d& uv) {
  return coat_probability(fresnel_dielectric(cos_i, b.eta), b.specular_reflectance,
                          b.base.reflectance, uv);
}
double coat_probability(const RoughPlastic& b, double cos_i, const Vec2d& uv) {
  return coat_probability(1.0 - b.transmittance.eval(cos_i), b.specular_reflectance,
                          b.base.reflectance, uv);
}

std::optional<BsdfSample> sample_bsdf(const Plastic& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  const double cos_i = at.n.dot(wi);
  if (cos_i <= 0.0) return std::nullopt;
  if (u.z() < coat_probability(b, cos_i, at.uv))
    return BsdfSample{reflect(wi, at.n), Scattering::Reflection, true};
  return reflected(to_world(square_to_cosine_hemisphere(u.x(), u.y()), at.n), wi, at.n);
}

double pdf_bsdf(const Plastic& b, const Point& at, const Vec3d& wi, const Vec3d& wo) {
  const double cos_i = at.n.dot(wi);
  if (cos_i <= 0.0) return 0.0;
  return (1.0 - coat_probability(b, cos_i, at.uv)) * std::max(0.0, at.n.dot(wo)) * kInvPi;
}

std::optional<BsdfSample> sample_bsdf(const RoughPlastic& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  const double cos_i = at.n.dot(wi);
  if (cos_i <= 0.0) return std::nullopt;
  if (!(u.z() < coat_probability(b, cos_i, at.uv)))
    return reflected(to_world(square_to_cosine_hemisphere(u.x(), u.y()), at.n), wi, at.n);
  const Vec3d h = to_world(b.microfacets.sample(to_local(wi, at.n), u.x(), u.y()), at.n);
  return reflected(reflect(wi, h), wi, at.n);
}

double pdf_bsdf(const RoughPlastic& b, const Point& at, const Vec3d& wi, const Vec3d& wo) {
  const double cos_i = at.n.dot(wi);
  const double cos_o = at.n.dot(wo);
  if (cos_i <= 0.0 || cos_o <= 0.0) return 0.0;
  const double coat = coat_probability(b, cos_i, at.uv);
  const Vec3d h = (wi + wo).normalized();
  const double ih = wi.dot(h);
  return coat * b.microfacets.pdf(cos_i, at.n.dot(h), ih) / (4.0 * ih) +
         (1.0 - coat) * cos_o * kInvPi;
}

std::optional<BsdfSample> sample_bsdf(const ThinDielectric& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  const double r = fresnel_dielectric(std::abs(at.n.dot(wi)), b.eta);
  if (u.z() < 2.0 * r / (1.0 + r))
    return BsdfSample{reflect(wi, at.n), Scattering::Reflection, true};
  return BsdfSample{-wi, Scattering::Transmission, true};
}

double pdf_bsdf(const ThinDielectric&, const Point&, const Vec3d&, const Vec3d&) { return 0.0; }

/// With which the nested BSDF is sampled.
double nested_probability(const Mask& b, const Vec2d& uv) {
  return std::clamp(luminance(b.opacity.eval(uv)), 0.0, 1.0);
}

std::optional<BsdfSample> sample_bsdf(const Mask& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  const double p = nested_probability(b, at.uv);
  if (!(u.z() < p)) return BsdfSample{-wi, Scattering::Transmission, true};
  if (b.nested == nullptr) return std::nullopt;
  return sample(b.nested->bsdf, at, wi, {u.x(), u.y(), u.z() / p});
}

double pdf_bsdf(const Mask& b, const Point& at, const Vec3d& wi, const Vec3d& wo) {
  if (b.nested == nullptr) return 0.0;
  return nested_probability(b, at.uv) * pdf(b.nested->bsdf, at, wi, wo);
}

double delta_probability_of(const Conductor&, const Point&, const Vec3d&, Scattering scattering) {
  return scattering == Scattering::Reflection ? 1.0 : 0.0;
}
double delta_probability_of(const Dielectric& b, const Point& at, const Vec3d& wi,
                            Scattering scattering) {
  const double reflection = detail::interface_reflectance(b.eta, at.n.dot(wi));
  return scattering == Scattering::Reflection ? reflection : 1.0 - reflection;
}
double delta_probability_of(const ThinDielectric& b, const Point& at, const Vec3d& wi,
                            Scattering scattering) {
  const double r = fresnel_dielectric(std::abs(at.n.dot(wi)), b.eta);
  return (scattering == Scattering::Reflection ? 2.0 * r : 1.0 - r) / (1.0 + r);
}
double delta_probability_of(const Plastic& b, const Point& at, const Vec3d& wi,
                            Scattering scattering) {
  const double cos_i = at.n.dot(wi);
  if (scattering == Scattering::Transmission || cos_i <= 0.0) return 0.0;
  return coat_probability(b, cos_i, at.uv);
}
double delta_probability_of(const Mask& b, const Point& at, const Vec3d& wi,
                            Scattering scattering) {
  const double p = nested_probability(b, at.uv);
  double result = scattering == Scattering::Transmission ? 1.0 - p : 0.0;
  if (b.nested != nullptr) result += p * delta_probability(b.nested->bsdf, at, wi, scattering);
  return result;
}
/// Those that have no delta lobe.
template <class B>
double delta_probability_of(const B&, const Point&, const Vec3d&, Scattering) {
  return 0.0;
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
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested == nullptr || is_delta(mask->nested->bsdf);
  return std::holds_alternative<Conductor>(bsdf) || std::holds_alternative<Dielectric>(bsdf) ||
         std::holds_alternative<ThinDielectric>(bsdf);
}

bool has_delta(const Bsdf& bsdf, Scattering scattering) {
  if (std::holds_alternative<Dielectric>(bsdf) || std::holds_alternative<ThinDielectric>(bsdf))
    return true;
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return scattering == Scattering::Transmission ||
           (mask->nested != nullptr && has_delta(mask->nested->bsdf, scattering));
  const bool reflects =
      std::holds_alternative<Conductor>(bsdf) || std::holds_alternative<Plastic>(bsdf);
  return reflects && scattering == Scattering::Reflection;
}

bool is_transmissive(const Bsdf& bsdf) {
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested == nullptr || is_transmissive(mask->nested->bsdf);
  return std::holds_alternative<Dielectric>(bsdf) ||
         std::holds_alternative<RoughDielectric>(bsdf) ||
         std::holds_alternative<ThinDielectric>(bsdf);
}

bool is_diffuse(const Bsdf& bsdf) {
  if (const auto* mask = std::get_if<Mask>(&bsdf))
    return mask->nested != nullptr && is_diffuse(mask->nested->bsdf);
  return std::holds_alternative<Diffuse>(bsdf) || std::holds_alternative<Plastic>(bsdf);
}

double delta_eta(const Bsdf& bsdf) {
  const auto* glass = std::get_if<Dielectric>(&bsdf);
  return glass != nullptr ? glass->eta : 1.0;
}

std::optional<BsdfSample> sample(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                                 const Vec3d& u) {
  return std::visit([&](const auto& b) { return sample_bsdf(b, at, wi, u); }, bsdf);
}

double pdf(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi, const Vec3d& wo) {
  return std::visit([&](const auto& b) { return pdf_bsdf(b, at, wi, wo); }, bsdf);
}

double delta_probability(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                         Scattering scattering) {
  return std::visit([&](const auto& b) { return delta_probability_of(b, at, wi, scattering); },
                    bsdf);
}

}  // namespace driftlight
