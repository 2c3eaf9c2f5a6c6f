// SPDX-License-Identifier: Apache-2.0
/// Colours of scene files.
#pragma once

#include "driftlight/scalar.h"
#include "xml_document.h"

namespace driftlight {

inline const Rgbd kWhite{1, 1, 1};

/// Linear sRGB of <rgb> or <srgb> (one value, three values or #rrggbb), of <spectrum> (see
/// spectrum_xml.h), of <blackbody> (`temperature` in kelvin, `scale`), or of <float> (grey). Throws
/// SceneError on negative values.
Rgbd read_color(const Element& element);

}  // namespace driftlight
