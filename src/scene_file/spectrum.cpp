// SPDX-License-Identifier: Apache-2.0
#include "spectrum.h"

#include <algorithm>
#include <cmath>

#include "cie_1931.h"

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

/// Integral of the matching functions times the linear function through samples a and b, over
/// [a, b] as far as the observer sees. The integrand is a quadratic between nanometres, and
/// Simpson's rule is exact for it.
Vec3d integrate_segment(const SpectrumSample& a, const SpectrumSample& b) {
  const double first = std::max(a.wavelength, static_cast<double>(kCieFirst));
  const double last = std::min(b.wavelength, static_cast<double>(kCieFirst + kCieSamples - 1));
  const double slope = (b.value - a.value) / (b.wavelength - a.wavelength);
  const auto integrand = [&](double wavelength) {
    const double value = a.value + slope * (wavelength - a.wavelength);
    return Vec3d(value * matching_functions(wavelength));
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

Vec3d integrate(const Spectrum& spectrum) {
  Vec3d sum = Vec3d::Zero();
  for (std::size_t i = 1; i < spectrum.size(); ++i)
    sum += integrate_segment(spectrum[i - 1], spectrum[i]);
  return sum;
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

Rgbd spectrum_to_rgb(const Spectrum& spectrum) {
  static const double y_integral =
      integrate({{kCieFirst, 1.0}, {kCieFirst + kCieSamples - 1, 1.0}}).y();
  return xyz_to_rgb(integrate(spectrum) / y_integral).max(0.0);
}

double srgb_to_linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

}  // namespace driftlight
