// SPDX-License-Identifier: Apache-2.0
/// Spectra given as lists, and their colours.
#pragma once

#include <vector>

#include "driftlight/scalar.h"

namespace driftlight {

struct SpectrumSample {
  double wavelength = 0;  ///< nm
  double value = 0;
};

/// Linear between the samples (at least two, by growing wavelength; two of the same are a jump),
/// zero outside of them.
using Spectrum = std::vector<SpectrumSample>;

/// The spectrum with a ramp at each end that is not zero: down to zero over the mean spacing of the
/// samples, which is how Mitsuba continues lists in scene files.
Spectrum ramp_to_zero(Spectrum spectrum);

/// Between two samples the line that has the values of each at the other. So Mitsuba interpolated
/// until 2020 (commit cfeb776 mended InterpolatedSpectrum::eval), versions 0.5 and before for ever:
/// in the Cornell box that makes a tenth of a list in steps of 100 nm, and 0.6 % at most of a
/// channel of one in steps of 4 nm.
Spectrum interpolated_backwards(const Spectrum& spectrum);

/// Linear sRGB of a spectrum, as a Mitsuba of three channels sees it: XYZ is the integral of the
/// spectrum times the CIE 1931 matching functions, over the integral of y; exact for the piecewise
/// linear tables. Equal energy 1 gives (1.2049, 0.9483, 0.9093), not white. Negative components,
/// of colours outside of the gamut, become 0.
Rgbd spectrum_to_rgb(const Spectrum& spectrum);

/// Linear sRGB of a surface of this reflectance in daylight (D65), as a Mitsuba 3 of three channels
/// sees it: reflectance 1 is white. Negative components become 0.
Rgbd reflectance_to_rgb(const Spectrum& reflectance);

/// Radiance of a black body, W / (m^2 sr nm), over the visible range.
Spectrum blackbody(double kelvin);

/// The inverse of the sRGB transfer curve, for values from 0 to 1.
double srgb_to_linear(double encoded);

}  // namespace driftlight
