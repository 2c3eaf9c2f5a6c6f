// SPDX-License-Identifier: Apache-2.0
/// The numbers of colours and spectra, none of which is negative.
#pragma once

#include <string>
#include <vector>

#include "driftlight/scalar.h"
#include "xml_document.h"

namespace driftlight {

/// Throws SceneError at the element unless the text is a number that is not negative.
double read_color_value(const Element& element, const std::string& text);

/// One value for all components, or three. Throws SceneError.
Rgbd read_color_values(const Element& element, const std::vector<std::string>& parts);

}  // namespace driftlight
