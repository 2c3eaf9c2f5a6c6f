// SPDX-License-Identifier: Apache-2.0
/// Rougher versions of BSDFs, for the softer levels of tempered splitting (DESIGN 1.10).
#pragma once

#include "driftlight/bsdf.h"

namespace driftlight {

/// The least roughness alpha of its glossy lobes along any axis, for Phong's exponent n the alpha
/// of n + 2 = 2 / alpha^2; infinite if it has none. Smooth lobes do not count.
double least_roughness(const Bsdf& bsdf);

/// The BSDF with a roughness of at least alpha in all its glossy lobes. It has the same lobes, is
/// positive wherever the BSDF is, and there less than it by about (ratio of the roughnesses)^2 at
/// most. Of rough plastic the coat's transmittance stays as it is: a level need not be physical.
Bsdf softened(Bsdf bsdf, double alpha);

}  // namespace driftlight
