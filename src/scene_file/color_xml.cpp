// SPDX-License-Identifier: Apache-2.0
#include "color_xml.h"

#include <charconv>

#include "spectrum.h"
#include "text.h"

namespace driftlight {
namespace {

double read_value(const Element& element, const std::string& text) {
  const auto value = parse_number(text);
  if (!value) element.fail("'" + text + "' is not a finite number");
  if (*value < 0.0) element.fail("'" + text + "' is negative");
  return *value;
}

Rgbd read_hexadecimal(const Element& element, const std::string& text) {
  unsigned code = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + 1, end, code, 16);
  if (text.size() != 7 || error != std::errc() || stop != end)
    element.fail("'" + text + "' is not a colour of the form #rrggbb");
  return Rgbd(code >> 16U & 0xFFU, code >> 8U & 0xFFU, code & 0xFFU) / 255.0;
}

Rgbd read_triple(const Element& element, const std::vector<std::string>& parts) {
  if (parts.size() == 1) return Rgbd::Constant(read_value(element, parts[0]));
  if (parts.size() != 3)
    element.fail("a colour has 1 or 3 values, not " + std::to_string(parts.size()));
  return {read_value(element, parts[0]), read_value(element, parts[1]),
          read_value(element, parts[2])};
}

Rgbd read_wavelengths(const Element& element, const std::vector<std::string>& parts) {
  Spectrum spectrum;
  for (const std::string& part : parts) {
    const std::vector<std::string> pair = split(part, ":");
    if (pair.size() != 2) element.fail("'" + part + "' is not of the form wavelength:value");
    const SpectrumSample sample{read_value(element, pair[0]), read_value(element, pair[1])};
    if (!spectrum.empty() && sample.wavelength <= spectrum.back().wavelength)
      element.fail("wavelengths must grow, but " + pair[0] + " follows");
    spectrum.push_back(sample);
  }
  if (spectrum.size() < 2) element.fail("a spectrum needs at least two wavelengths");
  return spectrum_to_rgb(ramp_to_zero(std::move(spectrum)));
}

}  // namespace

Rgbd read_color(const Element& element) {
  element.allow_attributes({"name", "value", "intent"});
  const std::string text = element.text("value");
  const std::vector<std::string> parts = split_list(text);
  if (element.tag() == "spectrum")
    return text.find(':') == std::string::npos ? read_triple(element, parts)
                                               : read_wavelengths(element, parts);
  const bool hexadecimal = parts.size() == 1 && parts[0].front() == '#';
  const Rgbd rgb = hexadecimal ? read_hexadecimal(element, parts[0]) : read_triple(element, parts);
  return element.tag() == "srgb" ? rgb.unaryExpr(&srgb_to_linear).eval() : rgb;
}

}  // namespace driftlight
