// SPDX-License-Identifier: Apache-2.0
/// The materials of Wavefront files (.mtl), as Mitsuba 0.6 takes them.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "load_context.h"

namespace driftlight {

using MaterialLibrary = std::map<std::string, std::shared_ptr<Surface>>;

/// By name. Of a material count Kd, Ks (both in sRGB), map_Kd, map_Ks, Ns, illum, bump, d and
/// map_d:
///   illum 2              phong, if it has Ks and Ns; else diffuse
///   illum 4, 6, 7, 9     dielectric
///   illum 5, 8           conductor of aluminium
///   other                diffuse
/// under a bump map and a mask, where it has these; glass has no mask, which a notice says.
/// Textures that cannot be found are black, and named in a notice for the element that asked for
/// the file. Throws SceneError.
MaterialLibrary read_material_library(const std::filesystem::path& file, const Element& element,
                                      LoadContext& context);

}  // namespace driftlight
