// SPDX-License-Identifier: Apache-2.0
/// Standard daylight.
#pragma once

#include "spectrum.h"

namespace driftlight {

/// CIE standard illuminant D65, relative power; linear between its samples, as it is defined.
const Spectrum& cie_d65();

}  // namespace driftlight
