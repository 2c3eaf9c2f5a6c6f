// SPDX-License-Identifier: Apache-2.0
#include "refractive_indices.h"

#include <array>
#include <span>
#include <utility>

#include "metals.h"
#include "spectrum.h"
#include "text.h"

namespace driftlight {
namespace {

/// At 589 nm, the names and values of Mitsuba (mostly from Hecht, "Optics", 4th edition).
constexpr std::array<std::pair<std::string_view, double>, 23> kDielectrics{{
    {"vacuum", 1.0},      {"helium", 1.000036},        {"hydrogen", 1.000132},
    {"air", 1.000277},    {"carbon dioxide", 1.00045}, {"water", 1.333},
    {"acetone", 1.36},    {"ethanol", 1.361},          {"carbon tetrachloride", 1.461},
    {"glycerol", 1.4729}, {"benzene", 1.501},          {"silicone oil", 1.52045},
    {"bromine", 1.661},   {"water ice", 1.31},         {"fused quartz", 1.458},
    {"pyrex", 1.47},      {"acrylic glass", 1.49},     {"polypropylene", 1.49},
    {"bk7", 1.5046},      {"sodium chloride", 1.544},  {"amber", 1.55},
    {"pet", 1.575},       {"diamond", 2.419},
}};

/// An entry by name in lower case, or a SceneError naming the nearest ones.
template <class Table>
auto& find_substance(Properties& properties, std::string_view property, const std::string& name,
                     const Table& table) {
  std::vector<std::string> names;
  for (auto& entry : table) {
    if (lower_case(entry.first) == lower_case(name)) return entry.second;
    names.emplace_back(entry.first);
  }
  properties.fail(property, "'" + name + "' is not known; " + hint(name, names));
}

Rgbd to_rgb(std::span<const MetalSample> samples, double MetalSample::*part) {
  Spectrum spectrum;
  for (const MetalSample& sample : samples) spectrum.push_back({sample.wavelength, sample.*part});
  return spectrum_to_rgb(spectrum);
}

}  // namespace

double read_index(Properties& properties, std::string_view name, std::string_view fallback) {
  const auto child = properties.find(name);
  if (child && child->tag() != "string") return properties.positive(name, 1.0);
  const std::string substance = properties.text(name).value_or(std::string(fallback));
  return find_substance(properties, name, substance, kDielectrics);
}

MetalIndex find_metal(Properties& properties, const std::string& name) {
  // Mitsuba names some after their source too, and has some from two.
  constexpr std::string_view kSource = "_palik";
  const bool sourced = lower_case(name).ends_with(kSource);
  const Metal& metal =
      find_substance(properties, "material",
                     sourced ? name.substr(0, name.size() - kSource.size()) : name, metals());
  return {to_rgb(metal.samples, &MetalSample::eta), to_rgb(metal.samples, &MetalSample::k),
          std::string(metal.source)};
}

}  // namespace driftlight
