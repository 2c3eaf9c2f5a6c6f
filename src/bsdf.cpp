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
  return BsdfSample{reflect(wi, at.n), Scattering::Reflection};
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

double reflection_probability(const Dielectric& b, double cos_i) {
  return fresnel_dielectric(std::abs(cos_i), cos_i > 0.0 ? b.eta : 1.0 / b.eta);
}

std::optional<BsdfSample> sample_bsdf(const Dielectric& b, const Point& at, const Vec3d& wi,
                                      const Vec3d& u) {
  const double cos_i = at.n.dot(wi);
  if (u.z() < reflection_probability(b, cos_i))
    return BsdfSample{reflect(wi, at.n), Scattering::Reflection};
  return BsdfSample{refract(wi, at.n, cos_i > 0.0 ? b.eta : 1.0 / b.eta), Scattering::Transmission};
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

}  // namespace

bool is_delta(const Bsdf& bsdf) {
  return std::holds_alternative<Conductor>(bsdf) || std::holds_alternative<Dielectric>(bsdf);
}

bool is_transmissive(const Bsdf& bsdf) {
  return std::holds_alternative<Dielectric>(bsdf) || std::holds_alternative<RoughDielectric>(bsdf);
}

bool is_diffuse(const Bsdf& bsdf) { return std::holds_alternative<Diffuse>(bsdf); }

std::optional<BsdfSample> sample(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                                 const Vec3d& u) {
  return std::visit([&](const auto& b) { return sample_bsdf(b, at, wi, u); }, bsdf);
}

double pdf(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi, const Vec3d& wo) {
  return std::visit([&](const auto& b) { return pdf_bsdf(b, at, wi, wo); }, bsdf);
}

double delta_probability(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                         Scattering scattering) {
  const auto* glass = std::get_if<Dielectric>(&bsdf);
  if (glass == nullptr) return scattering == Scattering::Reflection ? 1.0 : 0.0;
  const double reflection = reflection_probability(*glass, at.n.dot(wi));
  return scattering == Scattering::Reflection ? reflection : 1.0 - reflection;
}

}  // namespace driftlight
