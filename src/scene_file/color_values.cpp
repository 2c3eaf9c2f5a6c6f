// SPDX-License-Identifier: Apache-2.0
#include "color_values.h"

#include "text.h"

namespace driftlight {

double read_color_value(const Element& element, const std::string& text) {
  const auto value = parse_number(text);
  if (!value) element.fail("'" + text + "' is not a finite number");
  if (*value < 0.0) element.fail("'" + text + "' is negative");
  return *value;
}

Rgbd read_color_values(const Element& element, const std::vector<std::string>& parts) {
  if (parts.size() == 1) return Rgbd::Constant(read_color_value(element, parts[0]));
  if (parts.size() != 3)
    element.fail("a colour has 1 or 3 values, not " + std::to_string(parts.size()));
  return {read_color_value(element, parts[0]), read_color_value(element, parts[1]),
          read_color_value(element, parts[2])};
}

}  // namespace driftlight
