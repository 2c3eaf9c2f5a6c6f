// SPDX-License-Identifier: Apache-2.0
#include "daylight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "cie_1931.h"
#include "spectrum.h"

namespace driftlight {
namespace {

constexpr double kDegree = kPi / 180.0;

/// Days from noon of 1 January 2000, universal time (Fliegel and Van Flandern's integer formula).
double days_since_2000(const PlaceAndTime& at, double hours) {
  const int shift = (at.month - 14) / 12;
  const int julian = 1461 * (at.year + 4800 + shift) / 4 + 367 * (at.month - 2 - 12 * shift) / 12 -
                     3 * ((at.year + 4900 + shift) / 100) / 4 + at.day - 32075;
  return julian - 0.5 + hours / 24.0 - 2451545.0;
}

// ---- Tables of the paper, by wavelength in nm -------------------------------------------------

/// Radiance of the sun before the air, 100 W / (m^2 sr nm), from 380 every 10 nm (table 2).
constexpr std::array<double, 38> kSolarRadiance{
    165.5, 162.3, 211.2, 258.8, 258.2, 242.3, 267.6, 296.6, 305.4, 300.6, 306.6, 288.3, 287.1,
    278.2, 271.0, 272.3, 263.6, 255.0, 250.6, 253.1, 253.5, 251.3, 246.3, 241.7, 236.8, 232.1,
    228.2, 223.4, 219.7, 215.3, 211.0, 207.3, 202.4, 198.7, 194.3, 190.7, 186.3, 182.6};

/// Absorption of ozone, 1 / cm.
const Spectrum& ozone() {
  static const Spectrum table{{355, 0.0},   {445, 0.003}, {450, 0.003}, {455, 0.004}, {460, 0.006},
                              {465, 0.008}, {470, 0.009}, {475, 0.012}, {480, 0.014}, {485, 0.017},
                              {490, 0.021}, {495, 0.025}, {500, 0.03},  {505, 0.035}, {510, 0.04},
                              {515, 0.045}, {520, 0.048}, {525, 0.057}, {530, 0.063}, {535, 0.07},
                              {540, 0.075}, {545, 0.08},  {550, 0.085}, {555, 0.095}, {560, 0.103},
                              {565, 0.11},  {570, 0.12},  {575, 0.122}, {580, 0.12},  {585, 0.118},
                              {590, 0.115}, {595, 0.12},  {600, 0.125}, {605, 0.13},  {610, 0.12},
                              {620, 0.105}, {630, 0.09},  {640, 0.079}, {650, 0.067}, {660, 0.057},
                              {670, 0.048}, {680, 0.036}, {690, 0.028}, {700, 0.023}, {710, 0.018},
                              {720, 0.014}, {730, 0.011}, {740, 0.01},  {750, 0.009}, {760, 0.007}};
  return table;
}
/// Of water vapour; that of mixed gases is 0 up to 759 nm.
const Spectrum& water() {
  static const Spectrum table{{689, 0.0}, {690, 0.016}, {700, 0.024}, {710, 0.0125},
                              {720, 1.0}, {730, 0.87},  {740, 0.061}, {750, 0.001}};
  return table;
}

/// Linear between the samples, 0 outside.
double interpolated(const Spectrum& table, double wavelength) {
  if (wavelength <= table.front().wavelength || wavelength >= table.back().wavelength) return 0.0;
  const auto next = std::find_if(table.begin(), table.end(), [&](const SpectrumSample& s) {
    return s.wavelength >= wavelength;
  });
  const SpectrumSample& a = *(next - 1);
  const double t = (wavelength - a.wavelength) / (next->wavelength - a.wavelength);
  return a.value + t * (next->value - a.value);
}

/// XYZ of the colour with chromaticity (x, y) and this Y, as linear sRGB.
Rgbd xyy_to_srgb(double x, double y, double luminance) {
  const Vec3d xyz(x / y * luminance, luminance, (1.0 - x - y) / y * luminance);
  Eigen::Matrix3d matrix;
  matrix << 3.240479, -1.537150, -0.498535,  //
      -0.969256, 1.875991, 0.041556,         //
      0.055648, -0.204043, 1.057311;
  return (matrix * xyz).array().max(0.0);
}

/// Integral of the matching function y, nm: luminance is 683 lm / W of it times a mean radiance.
double observer_width() {
  double sum = 0;
  for (std::size_t i = 1; i < kCie1931.size(); i += 3) sum += kCie1931[i];
  return sum;
}

double polynomial(const std::array<double, 4>& c, double t) {
  return ((c[0] * t + c[1]) * t + c[2]) * t + c[3];
}

/// [T^2 T 1] M [theta^3 theta^2 theta 1]^T
double zenith_chromaticity(const std::array<std::array<double, 4>, 3>& m, double turbidity,
                           double theta) {
  return (polynomial(m[0], theta) * turbidity + polynomial(m[1], theta)) * turbidity +
         polynomial(m[2], theta);
}

/// Directions of texels.
struct TexelGrid {
  int width;
  int height;

  double zenith(double y) const { return kPi * y / height; }
  double azimuth(double x) const { return 2.0 * kPi * x / width; }
  /// By its middle row.
  double solid_angle(int y) const {
    return 2.0 * kPi / width * (std::cos(zenith(y)) - std::cos(zenith(y + 1)));
  }
};

/// Adds the sun's disk: texels by the share of it that they cover, all together its power.
void add_sun(const TexelGrid& grid, const SunPosition& sun, double radius, const Rgbd& power,
             Bitmap& map) {
  const Vec3d axis = sun_direction(sun);
  const double cosine = std::cos(radius);
  const double texel = kPi / grid.height;
  const int samples = static_cast<int>(std::clamp(std::ceil(16.0 * texel / radius), 1.0, 64.0));
  const int margin = static_cast<int>(std::ceil(radius / texel)) + 1;
  const int row = static_cast<int>(sun.zenith / texel);
  std::vector<std::pair<std::size_t, double>> covered;  // texel, share of its solid angle
  double total = 0;
  for (int y = std::max(row - margin, 0); y <= std::min(row + margin, grid.height - 1); ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const Vec3d middle = sun_direction({grid.zenith(y + 0.5), grid.azimuth(x + 0.5)});
      if (middle.dot(axis) < std::cos(std::min(kPi, radius + 2.0 * texel))) continue;
      int inside = 0;
      for (int j = 0; j < samples; ++j) {
        const double zenith = grid.zenith(y + (j + 0.5) / samples);
        for (int i = 0; i < samples; ++i) {
          const double azimuth = grid.azimuth(x + (i + 0.5) / samples);
          if (sun_direction({zenith, azimuth}).dot(axis) >= cosine) ++inside;
        }
      }
      if (inside == 0) continue;
      const double share = static_cast<double>(inside) / (samples * samples);
      const auto index = static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) +
                         static_cast<std::size_t>(x);
      covered.emplace_back(index, share);
      total += share * grid.solid_angle(y);
    }
  }
  if (covered.empty()) {  // it is smaller than what lies between the samples
    const int y = std::min(row, grid.height - 1);
    const int x =
        std::min(static_cast<int>(sun.azimuth / (2.0 * kPi) * grid.width), grid.width - 1);
    covered.emplace_back(static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) +
                             static_cast<std::size_t>(x),
                         1.0);
    total = grid.solid_angle(y);
  }
  for (const auto& [index, share] : covered)
    map.texels[index] += (share / total * power).cast<float>();
}

}  // namespace

SunPosition sun_position(const PlaceAndTime& at) {
  const double hours = at.hour - at.timezone + (at.minute + at.second / 60.0) / 60.0;
  const double days = days_since_2000(at, hours);
  // Ecliptic coordinates.
  const double omega = 2.1429 - 0.0010394594 * days;
  const double anomaly = 6.2400600 + 0.0172019699 * days;
  const double longitude = 4.8950630 + 0.017202791698 * days + 0.03341607 * std::sin(anomaly) +
                           0.00034894 * std::sin(2.0 * anomaly) - 0.0001134 -
                           0.0000203 * std::sin(omega);
  const double obliquity = 0.4090928 - 6.2140e-9 * days + 0.0000396 * std::cos(omega);
  // Celestial coordinates.
  const double ascension =
      std::atan2(std::cos(obliquity) * std::sin(longitude), std::cos(longitude));
  const double declination = std::asin(std::sin(obliquity) * std::sin(longitude));
  // Local ones.
  const double sidereal = 6.6974243242 + 0.0657098283 * days + hours;
  const double hour_angle = (15.0 * sidereal + at.longitude) * kDegree - ascension;
  const double latitude = at.latitude * kDegree;
  const double cosine = std::cos(latitude) * std::cos(hour_angle) * std::cos(declination) +
                        std::sin(declination) * std::sin(latitude);
  const double zenith = std::acos(std::clamp(cosine, -1.0, 1.0));
  const double azimuth =
      std::atan2(-std::sin(hour_angle), std::tan(declination) * std::cos(latitude) -
                                            std::sin(latitude) * std::cos(hour_angle));
  const double parallax = 6371.01 / 149597890.0;
  return {zenith + parallax * std::sin(zenith), azimuth < 0.0 ? azimuth + 2.0 * kPi : azimuth};
}

Vec3d sun_direction(const SunPosition& sun) {
  const double sine = std::sin(sun.zenith);
  return {std::sin(sun.azimuth) * sine, std::cos(sun.zenith), -std::cos(sun.azimuth) * sine};
}

SunPosition position_of_sun(const Vec3d& direction) {
  const double azimuth = std::atan2(direction.x(), -direction.z());
  return {std::atan2(std::hypot(direction.x(), direction.z()), direction.y()),
          azimuth < 0.0 ? azimuth + 2.0 * kPi : azimuth};
}

/// Appendix 2 of the paper.
Daylight::Daylight(double turbidity, const SunPosition& sun) : turbidity_(turbidity), sun_(sun) {
  const double t = turbidity;
  const double theta = sun.zenith;
  const double chi = (4.0 / 9.0 - t / 120.0) * (kPi - 2.0 * theta);
  const double zenith = (4.0453 * t - 4.9710) * std::tan(chi) - 0.2155 * t + 2.4192;
  luminance_ = {0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771, -0.0670 * t + 0.3703, zenith};
  x_ = {-0.0193 * t - 0.2592,
        -0.0665 * t + 0.0008,
        -0.0004 * t + 0.2125,
        -0.0641 * t - 0.8989,
        -0.0033 * t + 0.0452,
        zenith_chromaticity({{{0.00166, -0.00375, 0.00209, 0.0},
                              {-0.02903, 0.06377, -0.03202, 0.00394},
                              {0.11693, -0.21196, 0.06052, 0.25886}}},
                            t, theta)};
  y_ = {-0.0167 * t - 0.2608,
        -0.0950 * t + 0.0092,
        -0.0079 * t + 0.2102,
        -0.0441 * t - 1.6537,
        -0.0109 * t + 0.0529,
        zenith_chromaticity({{{0.00275, -0.00610, 0.00317, 0.0},
                              {-0.04214, 0.08970, -0.04153, 0.00516},
                              {0.15346, -0.26756, 0.06670, 0.26688}}},
                            t, theta)};
}

double Daylight::Component::perez(double cosine, double gamma) const {
  const double c_gamma = std::cos(gamma);
  return (1.0 + a * std::exp(b / cosine)) * (1.0 + c * std::exp(d * gamma) + e * c_gamma * c_gamma);
}

double Daylight::value(const Component& component, double cosine, double gamma) const {
  return component.zenith * component.perez(cosine, gamma) / component.perez(1.0, sun_.zenith);
}

Rgbd Daylight::sky(double zenith, double from_sun) const {
  static const double radiance = 1000.0 / (683.0 * observer_width());  // of kcd / m^2
  const double cosine = std::max(std::cos(zenith), 1e-3);
  const double luminance = std::max(0.0, value(luminance_, cosine, from_sun));
  return xyy_to_srgb(value(x_, cosine, from_sun), value(y_, cosine, from_sun),
                     radiance * luminance);
}

/// Appendix 1: the solar spectrum times the transmittances of scattering by molecules (Rayleigh)
/// and aerosols (Angstrom), of ozone and of water vapour, along the relative mass of air m.
Rgbd Daylight::sun() const {
  const double m =
      1.0 / (std::cos(sun_.zenith) + 0.15 * std::pow(93.885 - sun_.zenith / kDegree, -1.253));
  const double beta = 0.04608 * turbidity_ - 0.04586;
  Spectrum spectrum;
  for (std::size_t i = 0; i < kSolarRadiance.size(); ++i) {
    const double wavelength = 380.0 + 10.0 * static_cast<double>(i);
    const double micrometres = 1e-3 * wavelength;
    const double vapour = 2.0 * interpolated(water(), wavelength) * m;
    const double depth = 0.008735 * std::pow(micrometres, -4.08) * m +
                         beta * std::pow(micrometres, -1.3) * m +
                         0.35 * interpolated(ozone(), wavelength) * m +
                         0.2385 * vapour / std::pow(1.0 + 20.07 * vapour, 0.45);
    spectrum.push_back({wavelength, 100.0 * kSolarRadiance[i] * std::exp(-depth)});
  }
  return spectrum_to_rgb(spectrum);
}

Bitmap daylight_map(double turbidity, const SunPosition& sun, const DaylightMap& how) {
  const Daylight daylight(turbidity, sun);
  const Vec3d to_sun = sun_direction(sun);
  const TexelGrid grid{how.width, how.width / 2};
  Bitmap map;
  map.width = grid.width;
  map.height = grid.height;
  map.texels.assign(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height),
                    Eigen::Array3f::Zero());
  for (int y = 0; how.sky_scale > 0.0 && y < grid.height; ++y) {
    double zenith = grid.zenith(y + 0.5) / how.stretch;
    if (zenith >= 0.5 * kPi) {
      if (!how.extend) break;
      zenith = 0.5 * kPi;
    }
    for (int x = 0; x < grid.width; ++x) {
      const Vec3d v = sun_direction({zenith, grid.azimuth(x + 0.5)});
      const double from_sun = std::atan2(v.cross(to_sun).norm(), v.dot(to_sun));
      map.texels[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) +
                 static_cast<std::size_t>(x)] =
          (how.sky_scale * daylight.sky(zenith, from_sun)).cast<float>();
    }
  }
  if (how.sun_scale > 0.0) {
    const double solid_angle = 2.0 * kPi * (1.0 - std::cos(kSunRadius));
    add_sun(grid, {std::min(sun.zenith * how.stretch, kPi), sun.azimuth}, how.sun_radius,
            how.sun_scale * solid_angle * daylight.sun(), map);
  }
  return map;
}

}  // namespace driftlight
