// SPDX-License-Identifier: Apache-2.0
#include "sensor_xml.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>

#include "properties.h"
#include "text.h"

namespace driftlight {
namespace {

struct FilmSize {
  int width = 768;
  int height = 576;
};

/// Films are seen through the box filter here; what another filter would do differently is to blur
/// the image by a pixel or so.
void read_filter(Properties& film, LoadContext& context) {
  constexpr std::string_view kBox = "pixels are means over their squares (filter 'box')";
  const std::vector<Element> filters = film.nested({"rfilter"});
  if (filters.size() > 1) filters.back().fail("a second rfilter of the film");
  if (filters.empty()) {
    context.notice(film.element(),
                   fmt::format("without an rfilter Mitsuba takes 'gaussian'; here {}", kBox));
    return;
  }
  Properties filter(filters[0]);
  constexpr std::array<std::pair<std::string_view, bool>, 6> kFilters{{{"box", true},
                                                                       {"tent", false},
                                                                       {"gaussian", false},
                                                                       {"mitchell", false},
                                                                       {"catmullrom", false},
                                                                       {"lanczos", false}}};
  const bool is_box = find_plugin(kFilters, filter);
  const bool is_pixel = filter.positive("radius", 0.5) == 0.5;
  filter.ignore({"stddev", "B", "C", "lobes"});
  filter.finish();
  if (!is_box || !is_pixel)
    context.notice(filters[0], fmt::format("{} is not used: {}", filter.description(), kBox));
}

void reject_crop(Properties& film, const FilmSize& size) {
  const auto require = [&](std::string_view name, int value) {
    if (film.integer(name, value) != value) film.fail(name, "crop windows are not supported");
  };
  require("cropOffsetX", 0);
  require("cropOffsetY", 0);
  require("cropWidth", size.width);
  require("cropHeight", size.height);
}

FilmSize read_size(Properties& film) {
  constexpr std::int64_t kMaximumPixels = std::int64_t{1} << 28;
  const FilmSize size{film.integer("width", 768), film.integer("height", 576)};
  if (size.width <= 0) film.fail("width", "must be positive");
  if (size.height <= 0) film.fail("height", "must be positive");
  if (std::int64_t{size.width} * size.height > kMaximumPixels)
    film.element().fail("a film of " + std::to_string(size.width) + " x " +
                        std::to_string(size.height) + " pixels is too large; the limit is " +
                        std::to_string(kMaximumPixels) + " pixels");
  return size;
}

FilmSize read_film(const Element& element, LoadContext& context) {
  Properties film(element);
  const std::array<std::pair<std::string_view, bool>, 2> kinds{
      {{"hdrfilm", false}, {"ldrfilm", true}}};
  const bool tone_mapped = find_plugin(kinds, film);
  const FilmSize size = read_size(film);
  reject_crop(film, size);
  read_filter(film, context);
  film.ignore({"fileFormat", "pixelFormat", "componentFormat", "channelNames", "banner",
               "attachLog", "highQualityEdges", "filename", "sampleBorder", "compensate"});
  if (tone_mapped) {
    film.ignore({"gamma", "exposure", "tonemapMethod", "key", "burn"});
    context.notice(element, "the tone mapping of ldrfilm is not used: images hold radiance");
  }
  film.finish();
  return size;
}

FilmSize read_film_of(Properties& sensor, LoadContext& context) {
  const std::vector<Element> films = sensor.nested({"film"});
  if (films.size() != 1) sensor.element().fail("the sensor needs one <film>");
  return read_film(films[0], context);
}

/// tan(fov_x / 2) from a full angle across the diagonal (degrees).
double from_diagonal(double degrees, double aspect) {
  return std::tan(degrees * kPi / 360.0) / std::sqrt(1.0 + 1.0 / (aspect * aspect));
}

/// tan(fov_x / 2) from the focal length of a camera with film of 36 mm by 24 mm, "50mm".
double from_focal_length(Properties& sensor, double aspect) {
  std::string text = sensor.text("focalLength").value_or("50mm");
  if (text.ends_with("mm")) text.resize(text.size() - 2);
  const std::optional<double> length = parse_number(text);
  if (!length || !(*length > 0.0))
    sensor.fail("focalLength", "must be a positive length such as \"50mm\"");
  return from_diagonal(360.0 / kPi * std::atan(std::hypot(36.0, 24.0) / (2.0 * *length)), aspect);
}

/// Half the width of the image plane at distance 1, tan(fov_x / 2).
double read_half_width(Properties& sensor, double aspect) {
  std::string axis = sensor.choice("fovAxis", "x", {"x", "y", "diagonal", "smaller", "larger"});
  if (!sensor.has("fov")) return from_focal_length(sensor, aspect);
  if (sensor.has("focalLength")) sensor.fail("focalLength", "give either 'fov' or 'focalLength'");
  const double fov = sensor.number("fov", 0.0);
  if (!(fov > 0.0 && fov < 180.0)) sensor.fail("fov", "must be between 0 and 180 degrees");

  if (axis == "smaller") axis = aspect > 1.0 ? "y" : "x";
  if (axis == "larger") axis = aspect > 1.0 ? "x" : "y";
  if (axis == "diagonal") return from_diagonal(fov, aspect);
  const double half = std::tan(fov * kPi / 360.0);
  return axis == "y" ? half * aspect : half;
}

/// Mitsuba's cameras look along +z with +y up, which leaves +x on the left of the image.
void place(PerspectiveCamera& camera, Properties& sensor) {
  const Eigen::Affine3d to_world = sensor.transform("toWorld");
  const Eigen::Matrix3d axes = to_world.linear();
  if (!(axes * axes.transpose()).isIdentity(1e-3))
    sensor.fail("toWorld", "the transform of a sensor must not scale or shear");
  camera.origin = to_world.translation();
  camera.right = -axes.col(0).normalized();
  camera.up = axes.col(1).normalized();
  camera.forward = axes.col(2).normalized();
}

void reject_shift(Properties& sensor) {
  for (const std::string_view name : {"principalPointOffsetX", "principalPointOffsetY"})
    if (sensor.number(name, 0.0) != 0.0) sensor.fail(name, "shifted lenses are not supported");
}

/// How many samples a pixel gets is up to the command line; says which number the scene asks for.
void note_sampler(const Element& element, LoadContext& context) {
  Properties sampler(element);
  const int count = sampler.integer("sampleCount", 4);
  context.notice(element, fmt::format("{} is not used; its {} is --spp {} on the command line",
                                      sampler.description(),
                                      spelling("sampleCount", element.dialect()), count));
}

PerspectiveCamera read_perspective(Properties& sensor, LoadContext& context) {
  const FilmSize film = read_film_of(sensor, context);
  const double aspect = static_cast<double>(film.width) / film.height;
  PerspectiveCamera camera;
  place(camera, sensor);
  camera.film_width = film.width;
  camera.film_height = film.height;
  camera.half_width = read_half_width(sensor, aspect);
  camera.half_height = camera.half_width / aspect;
  camera.near_clip = sensor.positive("nearClip", 1e-2);
  camera.far_clip = sensor.positive("farClip", 1e4);
  if (!(camera.near_clip < camera.far_clip))
    sensor.fail("nearClip", "must be smaller than 'farClip'");
  reject_shift(sensor);
  // A pinhole has no focus, and nothing here moves.
  sensor.ignore({"focusDistance", "shutterOpen", "shutterClose"});
  for (const Element& sampler : sensor.nested({"sampler"})) note_sampler(sampler, context);
  return camera;
}

using SensorReader = PerspectiveCamera (*)(Properties&, LoadContext&);
constexpr std::array<std::pair<std::string_view, SensorReader>, 1> kSensors{
    {{"perspective", &read_perspective}}};

}  // namespace

PerspectiveCamera read_sensor(const Element& element, LoadContext& context) {
  Properties properties(element);
  const PerspectiveCamera camera = find_plugin(kSensors, properties)(properties, context);
  properties.finish();
  context.objects.define(element, NamedObjects::Other{});
  return camera;
}

}  // namespace driftlight
