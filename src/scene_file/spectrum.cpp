// SPDX-License-Identifier: Apache-2.0
#include "spectrum.h"

#include <algorithm>
#include <cmath>

#include "cie_1931.h"
#include "cie_d65.h"

namespace driftlight {
namespace {

/// The matching functions, linear between the nanometres of the table.
Vec3d matching_functions(double wavelength) {
  const double position = wavelength - kCieFirst;
  const int i = std::clamp(static_cast<int>(position), 0, kCieSamples - 2);
  const double t = position - i;
  const auto at = [](int k) {
    return Eigen::Map<const Vec3d>(&kCie1931[3 * static_cast<std::size_t>(k)]);
  };
  return (1.0 - t) * at(i) + t * at(i + 1);
}

/// Equal energy.
double white_light(double /*wavelength*/) { return 1.0; }

/// Linear between the samples, which are evenly spaced and cover what the observer sees.
double daylight(double wavelength) {
  const Spectrum& d65 = cie_d65();
  const double spacing = d65[1].wavelength - d65[0].wavelength;
  const double position = (wavelength - d65[0].wavelength) / spacing;
  const auto i = std::min(static_cast<std::size_t>(position), d65.size() - 2);
  const double t = position - static_cast<double>(i);
  return (1.0 - t) * d65[i].value + t * d65[i + 1].value;
}

using Illuminant = double (*)(double wavelength);

/// Integral of the matching functions times the linear function through samples a and b times the
/// illuminant, over [a, b] as far as the observer sees. The integrand is a cubic between
/// nanometres, and Simpson's rule is exact for it.
Vec3d integrate_segment(const SpectrumSample& a, const SpectrumSample& b, Illuminant illuminant) {
  const double first = std::max(a.wavelength, static_cast<double>(kCieFirst));
  const double last = std::min(b.wavelength, static_cast<double>(kCieFirst + kCieSamples - 1));
  const double slope = (b.value - a.value) / (b.wavelength - a.wavelength);
  const auto integrand = [&](double wavelength) {
    const double value = a.value + slope * (wavelength - a.wavelength);
    return Vec3d(value * illuminant(wavelength) * matching_functions(wavelength));
  };
  Vec3d sum = Vec3d::Zero();
  for (double left = first; left < last;) {
    const double right = std::min(std::floor(left) + 1.0, last);
    sum += (right - left) / 6.0 *
           (integrand(left) + 4.0 * integrand(0.5 * (left + right)) + integrand(right));
    left = right;
  }
  return sum;
}

Vec3d integrate(const Spectrum& spectrum, Illuminant illuminant) {
  Vec3d sum = Vec3d::Zero();
  for (std::size_t i = 1; i < spectrum.size(); ++i)
    sum += integrate_segment(spectrum[i - 1], spectrum[i], illuminant);
  return sum;
}

/// XYZ in units of the illuminant's Y.
Vec3d relative_xyz(const Spectrum& spectrum, Illuminant illuminant) {
  const Spectrum one{{kCieFirst, 1.0}, {kCieFirst + kCieSamples - 1, 1.0}};
  return integrate(spectrum, illuminant) / integrate(one, illuminant).y();
}

/// Rec. 709 primaries and D65 white.
Rgbd xyz_to_rgb(const Vec3d& xyz) {
  Eigen::Matrix3d matrix;
  matrix << 3.240479, -1.537150, -0.498535,  //
      -0.969256, 1.875991, 0.041556,         //
      0.055648, -0.204043, 1.057311;
  return matrix * xyz;
}

}  // namespace

Spectrum ramp_to_zero(Spectrum spectrum) {
  const double range = spectrum.back().wavelength - spectrum.front().wavelength;
  const double spacing = range / static_cast<double>(spectrum.size() - 1);
  if (spectrum.front().value != 0.0)
    spectrum.insert(spectrum.begin(), {spectrum.front().wavelength - spacing, 0.0});
  if (spectrum.back().value != 0.0) spectrum.push_back({spectrum.back().wavelength + spacing, 0.0});
  return spectrum;
}

Spectrum interpolated_backwards(const Spectrum& spectrum) {
  Spectrum result;
  for (std::size_t i = 1; i < spectrum.size(); ++i) {
    result.push_back({spectrum[i - 1].wavelength, spectrum[i].value});
    result.push_back({spectrum[i].wavelength, spectrum[i - 1].value});
  }
  return result;
}

Rgbd spectrum_to_rgb(const Spectrum& spectrum) {
  return xyz_to_rgb(relative_xyz(spectrum, &white_light)).max(0.0);
}

Rgbd reflectance_to_rgb(const Spectrum& reflectance) {
  return xyz_to_rgb(relative_xyz(reflectance, &daylight)).max(0.0);
}

Spectrum blackbody(double kelvin) {
  // Planck's law with the exact constants of the SI: h, c and k.
  constexpr double kPlanck = 6.62607015e-34;
  constexpr double kLight = 299792458.0;
  constexpr double kBoltzmann = 1.380649e-23;
  Spectrum spectrum;
  for (int nm = kCieFirst; nm < kCieFirst + kCieSamples; ++nm) {
    const double metres = 1e-9 * nm;
    const double exponent = kPlanck * kLight / (metres * kBoltzmann * kelvin);
    const double per_metre =
        2.0 * kPlanck * kLight * kLight / (std::pow(metres, 5) * std::expm1(exponent));
    spectrum.push_back({static_cast<double>(nm), 1e-9 * per_metre});
  }
  return spectrum;
}

double srgb_to_linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

}  // namespace driftlight
