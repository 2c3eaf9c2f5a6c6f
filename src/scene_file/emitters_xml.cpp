// SPDX-License-Identifier: Apache-2.0
#include "emitters_xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "bsdfs_xml.h"
#include "color_xml.h"
#include "daylight.h"
#include "properties.h"
#include "textures_xml.h"
#include "vertex_colors.h"

namespace driftlight {
namespace {

/// The rotation (or mirror rotation) in a transform that may also scale evenly: a scale means
/// nothing for directions.
Eigen::Matrix3d read_rotation(Properties& properties) {
  const Eigen::Matrix3d linear = properties.transform("toWorld").linear();
  const Eigen::Matrix3d rotation = linear / std::cbrt(std::abs(linear.determinant()));
  if (!(rotation * rotation.transpose()).isIdentity(1e-3))
    properties.fail("toWorld", "must be a rotation");
  return rotation;
}

void read_point(Properties& properties, LoadContext& context) {
  const std::optional<Vec3d> position = properties.point("position");
  if (position && properties.has("toWorld"))
    properties.fail("toWorld", "give either 'position' or 'toWorld'");
  const Vec3d origin = properties.transform("toWorld").translation();
  const PointEmitter emitter{position.value_or(origin), properties.color("intensity", kWhite)};
  if (emitter.intensity.maxCoeff() > 0.0) context.builder.add_emitter(emitter);
}

/// Degrees; at most `most`.
double read_angle(Properties& properties, std::string_view name, double fallback, double most) {
  const double angle = properties.number(name, fallback);
  if (!(angle >= 0.0 && angle <= most))
    properties.fail(name, fmt::format("{} is not an angle between 0 and {} degrees", angle, most));
  return angle;
}

void read_spot(Properties& properties, LoadContext& context) {
  if (properties.has("texture")) properties.fail("texture", "textured spots are not supported");
  const double cutoff = read_angle(properties, "cutoffAngle", 20.0, 180.0);
  if (cutoff == 0.0) properties.fail("cutoffAngle", "must be positive");
  const double beam = read_angle(properties, "beamWidth", 0.75 * cutoff, cutoff);
  const Vec3d axis = read_rotation(properties).col(2);
  const SpotEmitter emitter(properties.transform("toWorld").translation(), axis,
                            properties.color("intensity", kWhite), cutoff * kPi / 180.0,
                            beam * kPi / 180.0);
  if (emitter.intensity().maxCoeff() > 0.0) context.builder.add_emitter(emitter);
}

void read_directional(Properties& properties, LoadContext& context) {
  const std::optional<Vec3d> direction = properties.vector("direction");
  if (direction && properties.has("toWorld"))
    properties.fail("toWorld", "give either 'direction' or 'toWorld'");
  if (direction && direction->isZero(0.0)) properties.fail("direction", "must not be zero");
  const Vec3d along = direction.value_or(properties.transform("toWorld").linear().col(2));
  const DirectionalEmitter emitter{along.normalized(), properties.color("irradiance", kWhite)};
  if (emitter.irradiance.maxCoeff() > 0.0) context.builder.add_emitter(emitter);
}

void read_constant(Properties& properties, LoadContext& context) {
  properties.transform("toWorld");  // turning a constant changes nothing
  const ConstantEnvironment emitter{properties.color("radiance", kWhite)};
  if (emitter.radiance.maxCoeff() > 0.0)
    with_location(properties.element(), [&] { context.builder.set_environment(emitter); });
}

void read_environment_map(Properties& properties, LoadContext& context) {
  const std::string file = properties.required_text("filename");
  const std::optional<Gamma> gamma = read_gamma(properties);
  const double scale = properties.non_negative("scale", 1.0);
  const Eigen::Matrix3d to_world = read_rotation(properties);
  properties.ignore({"cache", "misCompensation"});
  with_location(properties.element(), [&] {
    Bitmap bitmap = read_image_file(properties.element().find_file(file), gamma).bitmap;
    const bool black = std::all_of(bitmap.texels.begin(), bitmap.texels.end(),
                                   [](const auto& texel) { return (texel == 0.0F).all(); });
    if (black || scale == 0.0) throw InputError("the environment map is black");
    context.builder.set_environment(EnvironmentMap(std::move(bitmap), to_world, scale));
  });
}

// ---- Daylight ---------------------------------------------------------------------------------

constexpr std::array<std::string_view, 9> kPlaceAndTime{
    "latitude", "longitude", "timezone", "year", "month", "day", "hour", "minute", "second"};

PlaceAndTime read_place_and_time(Properties& properties) {
  PlaceAndTime at;
  at.latitude = properties.number("latitude", at.latitude);
  at.longitude = properties.number("longitude", at.longitude);
  at.timezone = properties.number("timezone", at.timezone);
  at.year = properties.integer("year", at.year);
  at.month = properties.integer("month", at.month);
  at.day = properties.integer("day", at.day);
  at.hour = properties.number("hour", at.hour);
  at.minute = properties.number("minute", at.minute);
  at.second = properties.number("second", at.second);
  if (at.year < 1 || at.year > 9999) properties.fail("year", "must be between 1 and 9999");
  if (at.month < 1 || at.month > 12) properties.fail("month", "must be between 1 and 12");
  if (at.day < 1 || at.day > 31) properties.fail("day", "must be between 1 and 31");
  return at;
}

/// From the space of environment maps, y up, to that of daylight plugins: Mitsuba 3 has z up, and
/// azimuths from x over y.
Eigen::Matrix3d daylight_axes(Dialect dialect) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  if (dialect == Dialect::Mitsuba3) axes << 0, 0, -1, 1, 0, 0, 0, 1, 0;
  return axes;
}

/// By its direction in the world, or by place and time.
SunPosition read_sun_position(Properties& properties, const Eigen::Matrix3d& to_world) {
  const std::optional<Vec3d> direction = properties.vector("sunDirection");
  SunPosition sun;
  if (direction) {
    for (const std::string_view name : kPlaceAndTime)
      if (properties.has(name))
        properties.fail(name, "give either 'sunDirection' or a place and a time");
    if (direction->isZero(0.0)) properties.fail("sunDirection", "must not be zero");
    sun = position_of_sun(to_world.transpose() * *direction);
  } else {
    sun = sun_position(read_place_and_time(properties));
  }
  if (sun.zenith > 0.5 * kPi)
    properties.element().fail(
        fmt::format("the sun is {:.3g} degrees below the horizon", sun.zenith * 180.0 / kPi - 90));
  return sun;
}

double read_turbidity(Properties& properties, LoadContext& context) {
  constexpr double kLeastTurbidity = 2.0;
  const double turbidity = properties.number("turbidity", 3.0);
  if (!(turbidity >= 1.0 && turbidity <= 10.0))
    properties.fail("turbidity", "must be between 1 and 10");
  if (turbidity < kLeastTurbidity)
    context.notice(properties.element(), "turbidity is raised to 2, the least of Preetham's model");
  return std::max(turbidity, kLeastTurbidity);
}

/// The angular radius of the sun; 0: a directional emitter.
double read_sun_radius(Properties& properties) {
  if (properties.has("sunAperture")) {
    const double aperture = properties.positive("sunAperture", 0.5358);
    if (!(aperture < 180.0)) properties.fail("sunAperture", "must be below 180 degrees");
    return 0.5 * aperture * kPi / 180.0;
  }
  const double radius = kSunRadius * properties.non_negative("sunRadiusScale", 1.0);
  if (!(radius < 0.5 * kPi)) properties.fail("sunRadiusScale", "makes a sun of over 180 degrees");
  return radius;
}

int read_daylight_resolution(Properties& properties, bool has_sun) {
  // In Mitsuba 3 there is no map that the sun would have to be seen on.
  const bool fine = has_sun && properties.dialect() == Dialect::Mitsuba3;
  const int width = properties.integer("resolution", fine ? 2048 : 512);
  if (width < 8 || width > 16384) properties.fail("resolution", "must be between 8 and 16384");
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
  return std::min(width, 64);  // The widest maps take minutes under the sanitizers.
#else
  return width;
#endif
}

/// Both are scaled to nothing where the plugin lacks them.
void add_daylight(Properties& properties, LoadContext& context, double sky_scale,
                  double sun_scale) {
  const Eigen::Matrix3d to_world = read_rotation(properties) * daylight_axes(properties.dialect());
  const SunPosition sun = read_sun_position(properties, to_world);
  const double turbidity = read_turbidity(properties, context);
  DaylightMap how;
  how.sky_scale = sky_scale;
  how.sun_scale = sun_scale;
  how.width = read_daylight_resolution(properties, sun_scale > 0.0);
  how.stretch = properties.number("stretch", 1.0);
  if (!(how.stretch >= 1.0 && how.stretch <= 2.0))
    properties.fail("stretch", "must be between 1 and 2");
  how.extend = properties.boolean("extend", false);
  how.sun_radius = read_sun_radius(properties);
  if (how.sun_radius == 0.0 && sun_scale > 0.0) {
    how.sun_scale = 0.0;
    const double solid_angle = 2.0 * kPi * (1.0 - std::cos(kSunRadius));
    const SunPosition place{how.stretch * sun.zenith, sun.azimuth};
    context.builder.add_emitter(
        DirectionalEmitter{-(to_world * sun_direction(place)),
                           sun_scale * solid_angle * Daylight(turbidity, sun).sun()});
  }
  if (how.sky_scale == 0.0 && how.sun_scale == 0.0) return;
  // What is wrong is to be said before a large map is computed.
  properties.finish();
  if (context.surroundings.messages.has_errors()) return;
  with_location(properties.element(), [&] {
    context.builder.set_environment(
        EnvironmentMap(daylight_map(turbidity, sun, how), to_world, 1.0));
  });
}

/// Mitsuba's skies are Hosek and Wilkie's.
void note_sky(Properties& properties, LoadContext& context) {
  properties.ignore({"albedo"});
  context.notice(properties.element(),
                 "the sky is that of Preetham et al. 1999, not of Hosek and Wilkie 2012; it knows "
                 "no albedo of the ground");
}

void read_sky(Properties& properties, LoadContext& context) {
  note_sky(properties, context);
  add_daylight(properties, context, properties.non_negative("scale", 1.0), 0.0);
}

void read_sun(Properties& properties, LoadContext& context) {
  add_daylight(properties, context, 0.0, properties.non_negative("scale", 1.0));
}

void read_sun_and_sky(Properties& properties, LoadContext& context) {
  note_sky(properties, context);
  const bool newer = properties.dialect() == Dialect::Mitsuba3;
  if (newer) properties.ignore({"complexSun"});
  const double both = newer ? 1.0 : properties.non_negative("scale", 1.0);
  const double sky_scale = properties.non_negative("skyScale", both);
  add_daylight(properties, context, sky_scale, properties.non_negative("sunScale", both));
}

void reject_area(Properties& properties, LoadContext&) {
  properties.element().fail("an area emitter must be inside of a shape");
}

using EmitterReader = void (*)(Properties&, LoadContext&);
constexpr std::array<std::pair<std::string_view, EmitterReader>, 9> kEmitters{{
    {"point", &read_point},
    {"spot", &read_spot},
    {"directional", &read_directional},
    {"constant", &read_constant},
    {"envmap", &read_environment_map},
    {"sky", &read_sky},
    {"sun", &read_sun},
    {"sunsky", &read_sun_and_sky},
    {"area", &reject_area},
}};

}  // namespace

void read_emitter(const Element& element, LoadContext& context) {
  if (context.objects.is_read(element)) return;
  Properties properties(element);
  // It lights up where a shape refers to it.
  if (properties.type() == "area" && element.dialect() == Dialect::Mitsuba3) {
    read_area_radiance(element, context);
    return;
  }
  properties.ignore({"samplingWeight"});
  find_plugin(kEmitters, properties)(properties, context);
  properties.finish();
  context.has_emitter = true;
  context.objects.define(element, NamedObjects::Other{});
}

bool is_area_emitter(const Element& element, LoadContext& context) {
  if (element.tag() == "emitter") return true;
  if (element.tag() != "ref" || element.dialect() != Dialect::Mitsuba3) return false;
  context.objects.read_ahead(element, "emitter",
                             [&](const Element& target) { read_emitter(target, context); });
  context.objects.read_ahead(element, "bsdf",
                             [&](const Element& target) { read_surface(target, context); });
  return context.objects.names<NamedObjects::Radiance>(element);
}

Texture read_area_radiance(const Element& element, LoadContext& context) {
  if (element.tag() == "ref")
    return context.objects.resolve<NamedObjects::Radiance>(element, "area emitter").texture;
  Properties properties(element);
  if (properties.type() != "area")
    element.fail("unknown " + properties.description() + " in a shape; valid are: area");
  const Texture radiance = read_textured(properties, "radiance", kWhite, context);
  if (is_vertex_colors(radiance))
    properties.fail("radiance", "vertex colours cannot be a radiance");
  properties.ignore({"samplingWeight"});
  properties.finish();
  context.objects.define(element, NamedObjects::Radiance{radiance});
  return radiance;
}

}  // namespace driftlight
