// SPDX-License-Identifier: Apache-2.0
#include "emitters_xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "color_xml.h"
#include "properties.h"
#include "textures_xml.h"

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
    Bitmap bitmap = read_bitmap(properties.element().find_file(file), gamma);
    const bool black = std::all_of(bitmap.texels.begin(), bitmap.texels.end(),
                                   [](const auto& texel) { return (texel == 0.0F).all(); });
    if (black || scale == 0.0) throw InputError("the environment map is black");
    context.builder.set_environment(EnvironmentMap(std::move(bitmap), to_world, scale));
  });
}

void reject_area(Properties& properties, LoadContext&) {
  properties.element().fail("an area emitter must be inside of a shape");
}

using EmitterReader = void (*)(Properties&, LoadContext&);
constexpr std::array<std::pair<std::string_view, EmitterReader>, 6> kEmitters{{
    {"point", &read_point},
    {"spot", &read_spot},
    {"directional", &read_directional},
    {"constant", &read_constant},
    {"envmap", &read_environment_map},
    {"area", &reject_area},
}};

}  // namespace

void read_emitter(const Element& element, LoadContext& context) {
  Properties properties(element);
  find_plugin(kEmitters, properties)(properties, context);
  properties.ignore({"samplingWeight"});
  properties.finish();
  context.objects.define(element, NamedObjects::Other{});
}

Rgbd read_area_radiance(const Element& element, LoadContext& context) {
  Properties properties(element);
  if (properties.type() != "area")
    element.fail("unknown " + properties.description() + " in a shape; valid are: area");
  const Rgbd radiance = properties.color("radiance", kWhite);
  properties.ignore({"samplingWeight"});
  properties.finish();
  context.objects.define(element, NamedObjects::Other{});
  return radiance;
}

}  // namespace driftlight
