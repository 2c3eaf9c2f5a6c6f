// SPDX-License-Identifier: Apache-2.0
/// Spectra of scene files.
#pragma once

#include "driftlight/scalar.h"
#include "xml_document.h"

namespace driftlight {

/// Linear sRGB of <spectrum>: one value, three values, a list "wavelength:value, .." (nm), a `file`
/// of such pairs, or in the newer dialect one of the `type`s uniform, d65, rgb, srgb, regular,
/// irregular and blackbody. Lists mean what they mean to a Mitsuba of three channels: in the older
/// dialect all are light, in the newer one those outside of emitters reflect daylight. Throws
/// SceneError.
Rgbd read_spectrum(const Element& element);

/// Linear sRGB of a black body at `temperature` (kelvin, with or without a "K"), times `scale`.
Rgbd read_blackbody(const Element& element);

}  // namespace driftlight
