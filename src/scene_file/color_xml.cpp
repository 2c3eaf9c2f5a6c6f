// SPDX-License-Identifier: Apache-2.0
#include "color_xml.h"

#include <charconv>

#include "color_values.h"
#include "spectrum.h"
#include "spectrum_xml.h"
#include "text.h"

namespace driftlight {
namespace {

Rgbd read_hexadecimal(const Element& element, const std::string& text) {
  unsigned code = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + 1, end, code, 16);
  if (text.size() != 7 || error != std::errc() || stop != end)
    element.fail("'" + text + "' is not a colour of the form #rrggbb");
  return Rgbd(code >> 16U & 0xFFU, code >> 8U & 0xFFU, code & 0xFFU) / 255.0;
}

}  // namespace

Rgbd read_color(const Element& element) {
  const std::string tag = element.tag();
  if (tag == "spectrum") return read_spectrum(element);
  if (tag == "blackbody") return read_blackbody(element);
  element.allow_attributes({"name", "value", "intent"});
  const std::vector<std::string> parts = split_list(element.text("value"));
  const bool hexadecimal = parts.size() == 1 && parts[0].front() == '#';
  const Rgbd rgb =
      hexadecimal ? read_hexadecimal(element, parts[0]) : read_color_values(element, parts);
  return tag == "srgb" ? rgb.unaryExpr(&srgb_to_linear).eval() : rgb;
}

}  // namespace driftlight
