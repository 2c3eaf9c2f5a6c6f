// SPDX-License-Identifier: Apache-2.0
/// BSDFs: a closed set, each evaluated for every Scalar.
///
/// Conventions: wi points toward the previous vertex (the sensor's side), wo toward the next, both
/// unit and leaving the surface; n is the unit shading normal. Radiance flows from wo to wi.
/// `eval` includes |n . wo|. Isotropic BSDFs need no more of a frame than the normal.
#pragma once

#include <optional>

#include "driftlight/bsdf_delta.h"
#include "driftlight/bsdf_density.h"
#include "driftlight/bsdf_models.h"

namespace driftlight {

template <Scalar T>
struct BsdfSampleOf {
  Vec3<T> wo;
  Scattering scattering;
  bool delta = false;  ///< by a delta lobe
};
using BsdfSample = BsdfSampleOf<double>;

/// Draws wo from three numbers in [0, 1). None where the BSDF sends nothing.
std::optional<BsdfSample> sample(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                                 const Vec3d& u);

/// Density per solid angle of `sample` where it takes no delta lobe.
double pdf(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi, const Vec3d& wo);

/// Probability with which `sample` takes the delta lobe of this kind of scattering.
double delta_probability(const Bsdf& bsdf, const SurfacePoint<double>& at, const Vec3d& wi,
                         Scattering scattering);

}  // namespace driftlight
