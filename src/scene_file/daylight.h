// SPDX-License-Identifier: Apache-2.0
/// The clear sky and the sun of Preetham, Shirley and Smits, "A Practical Analytic Model for
/// Daylight", SIGGRAPH 1999, as an environment map.
#pragma once

#include "driftlight/texture.h"

namespace driftlight {

/// A place on the earth and a local time there.
struct PlaceAndTime {
  double latitude = 35.6894;    ///< degrees, north
  double longitude = 139.6917;  ///< degrees, east
  double timezone = 9;          ///< hours
  int year = 2010;
  int month = 7;
  int day = 10;
  double hour = 15;
  double minute = 0;
  double second = 0;
};

/// In radians: from the zenith, and from north over east.
struct SunPosition {
  double zenith = 0;
  double azimuth = 0;
};

/// Good to about half a minute of arc: Blanco-Muriel et al., "Computing the solar vector", Solar
/// Energy 70(5), 2001.
SunPosition sun_position(const PlaceAndTime& at);

/// Unit vector in the space of environment maps: y up, x east, -z north.
Vec3d sun_direction(const SunPosition& sun);
/// The inverse, for any length.
SunPosition position_of_sun(const Vec3d& direction);

/// Radiance in W / (m^2 sr nm) as linear sRGB (the mean over wavelengths that spectrum_to_rgb
/// takes).
class Daylight {
 public:
  /// Turbidity from 2 (very clear) to 10 (haze); the sun is not below the horizon.
  Daylight(double turbidity, const SunPosition& sun);

  /// Of the sky, at an angle from the zenith below pi / 2 and an angle from the sun (radians).
  Rgbd sky(double zenith, double from_sun) const;
  /// Of the sun's disk, through the air.
  Rgbd sun() const;

 private:
  /// Perez' five numbers, and the value at the zenith, of one component.
  struct Component {
    double a, b, c, d, e, zenith;
    /// F(theta, gamma) = (1 + A exp(B / cos theta)) (1 + C exp(D gamma) + E cos^2 gamma)
    double perez(double cosine, double gamma) const;
  };
  double value(const Component& component, double cosine, double gamma) const;

  double turbidity_;
  SunPosition sun_;
  Component luminance_, x_, y_;  ///< kcd / m^2; chromaticity
};

/// Angular radius of the sun's disk, in radians.
inline constexpr double kSunRadius = 0.5 * 0.5358 * kPi / 180.0;

struct DaylightMap {
  int width = 512;  ///< twice the height
  double sky_scale = 1;
  double sun_scale = 1;
  double sun_radius = kSunRadius;  ///< radians; the power stays that of kSunRadius
  double stretch = 1;              ///< of the sky's zenith angles, 1 to 2: below the horizon
  bool extend = false;             ///< the horizon's radiance below it
};

/// The map of sky and sun, in the layout of EnvironmentMap.
Bitmap daylight_map(double turbidity, const SunPosition& sun, const DaylightMap& how);

}  // namespace driftlight
