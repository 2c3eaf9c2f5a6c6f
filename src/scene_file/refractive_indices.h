// SPDX-License-Identifier: Apache-2.0
/// Refractive indices by name.
#pragma once

#include <string>

#include "driftlight/scalar.h"
#include "properties.h"

namespace driftlight {

/// Index of a dielectric: a <float>, or the name of a substance in a <string>.
double read_index(Properties& properties, std::string_view name, std::string_view fallback);

/// Complex index eta + i k of a metal against vacuum.
struct MetalIndex {
  Rgbd eta;
  Rgbd k;
  std::string source;  ///< who measured it
};

/// Throws SceneError about the property `material`, naming the valid metals.
MetalIndex find_metal(Properties& properties, const std::string& name);

}  // namespace driftlight
