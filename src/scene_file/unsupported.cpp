// SPDX-License-Identifier: Apache-2.0
#include "unsupported.h"

#include <algorithm>
#include <array>

namespace driftlight {
namespace {

struct PluginProperty {
  std::string_view tag;
  std::string_view type;  ///< empty: of any
  std::string_view name;  ///< in snake case
};

// What is asked for and then refused, such as the texture of a spot, is not among them.
constexpr std::array<PluginProperty, 12> kUnsupportedProperties{{
    {"shape", "", "interior"},
    {"shape", "", "exterior"},
    {"shape", "", "medium"},
    {"shape", "ply", "shape_index"},
    {"sensor", "", "medium"},
    {"sensor", "", "kc"},
    {"emitter", "", "medium"},
    {"emitter", "envmap", "bitmap"},
    {"texture", "bitmap", "channel"},
    {"texture", "bitmap", "bitmap"},
    {"spectrum", "", "wavelength_min"},
    {"spectrum", "", "wavelength_max"},
}};

constexpr std::array<std::string_view, 9> kPartsOfPicture{"subsurface", "medium",    "volume",
                                                          "phase",      "animation", "sensor",
                                                          "emitter",    "shape",     "include"};

constexpr std::array<std::string_view, 30> kTags{
    "shape",   "bsdf",       "emitter",   "sensor",    "film",      "rfilter",
    "sampler", "integrator", "texture",   "medium",    "volume",    "phase",
    "ref",     "alias",      "default",   "include",   "path",      "float",
    "integer", "boolean",    "string",    "point",     "vector",    "spectrum",
    "rgb",     "srgb",       "blackbody", "transform", "animation", "subsurface"};

}  // namespace

bool is_unsupported_property(std::string_view tag, std::string_view type, std::string_view name) {
  return std::any_of(kUnsupportedProperties.begin(), kUnsupportedProperties.end(),
                     [&](const PluginProperty& property) {
                       return property.tag == tag && property.name == name &&
                              (property.type.empty() || property.type == type);
                     });
}

bool is_part_of_picture(std::string_view tag) {
  return std::find(kPartsOfPicture.begin(), kPartsOfPicture.end(), tag) != kPartsOfPicture.end();
}

std::vector<std::string> known_tags() { return {kTags.begin(), kTags.end()}; }

}  // namespace driftlight
