// SPDX-License-Identifier: Apache-2.0
#include "driftlight/bsdf.h"

#include "bsdf_warp.h"

namespace driftlight {

bool is_delta(const Bsdf& bsdf) {
  return std::holds_alternative<Conductor>(bsdf) || std::holds_alternative<Dielectric>(bsdf);
}

bool is_transmissive(const Bsdf& bsdf) {
  return std::holds_alternative<Dielectric>(bsdf) || std::holds_alternative<RoughDielectric>(bsdf);
}

bool is_diffuse(const Bsdf& bsdf) { return std::holds_alternative<Diffuse>(bsdf); }

std::optional<BsdfSample> sample(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                                 const Vec3d& u) {
  const auto next = warp<double>(bsdf, at, wi, u);
  return next ? std::optional(BsdfSample{next->wo, next->scattering}) : std::nullopt;
}

double pdf(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi, const Vec3d& wo) {
  return pdf_of<double>(bsdf, at, wi, wo);
}

double delta_probability(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                         Scattering scattering) {
  return delta_probability_of<double>(bsdf, at, wi, scattering);
}

}  // namespace driftlight
