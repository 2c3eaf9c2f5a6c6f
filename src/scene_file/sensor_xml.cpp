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
  ReconstructionFilter filter;
  /// In pixels, from the top left.
  struct Crop {
    int x = 0;
    int y = 0;
    int width = 0;
    int height = 0;
  } crop;
};

using Kind = ReconstructionFilter::Kind;

/// The radius that follows from a property, if films can do that.
double checked_radius(Properties& filter, std::string_view property, double radius) {
  if (!(radius >= ReconstructionFilter::kMinimumRadius &&
        radius <= ReconstructionFilter::kMaximumRadius))
    filter.fail(
        property,
        fmt::format("makes a filter of radius {:g}; it must be between {:g} and {:g}", radius,
                    ReconstructionFilter::kMinimumRadius, ReconstructionFilter::kMaximumRadius));
  return radius;
}

ReconstructionFilter read_box(Properties& filter) {
  return {Kind::Box, checked_radius(filter, "radius", filter.positive("radius", 0.5))};
}
ReconstructionFilter read_tent(Properties& filter) {
  return {Kind::Tent, checked_radius(filter, "radius", filter.positive("radius", 1.0))};
}
/// As far as four standard deviations.
ReconstructionFilter read_gaussian(Properties& filter) {
  const double sigma = filter.positive("stddev", 0.5);
  return {Kind::Gaussian, checked_radius(filter, "stddev", 4.0 * sigma), sigma};
}
ReconstructionFilter read_mitchell(Properties& filter) {
  ReconstructionFilter result{Kind::Cubic, 2.0};
  result.b = filter.number("B", result.b);
  result.c = filter.number("C", result.c);
  return result;
}
ReconstructionFilter read_catmull_rom(Properties&) {
  ReconstructionFilter result{Kind::Cubic, 2.0};
  result.b = 0.0;
  result.c = 0.5;
  return result;
}
ReconstructionFilter read_lanczos(Properties& filter) {
  return {Kind::Lanczos, checked_radius(filter, "lobes", filter.integer("lobes", 3))};
}

/// That of films that have none, as in Mitsuba.
ReconstructionFilter default_filter() { return {Kind::Gaussian, 2.0}; }

ReconstructionFilter read_filter(Properties& film) {
  const std::vector<Element> filters = film.nested({"rfilter"});
  if (filters.size() > 1) filters.back().fail("a second rfilter of the film");
  if (filters.empty()) return default_filter();
  Properties filter(filters[0]);
  using Reader = ReconstructionFilter (*)(Properties&);
  constexpr std::array<std::pair<std::string_view, Reader>, 6> kFilters{
      {{"box", &read_box},
       {"tent", &read_tent},
       {"gaussian", &read_gaussian},
       {"mitchell", &read_mitchell},
       {"catmullrom", &read_catmull_rom},
       {"lanczos", &read_lanczos}}};
  const ReconstructionFilter result = find_plugin(kFilters, filter)(filter);
  filter.finish();
  return result;
}

/// The window of the film that is rendered; the camera's angles are those of the whole film.
void read_crop(Properties& film, FilmSize& size) {
  FilmSize::Crop& crop = size.crop;
  crop.x = film.integer("cropOffsetX", 0);
  crop.y = film.integer("cropOffsetY", 0);
  crop.width = film.integer("cropWidth", size.width);
  crop.height = film.integer("cropHeight", size.height);
  const auto require = [&](std::string_view name, int offset, int extent, int whole) {
    if (offset < 0 || extent <= 0 || extent > whole - offset)
      film.fail(name, fmt::format("makes a window from pixel {} to {} of a film of {}", offset,
                                  std::int64_t{offset} + extent, whole));
  };
  require(film.has("cropWidth") ? "cropWidth" : "cropOffsetX", crop.x, crop.width, size.width);
  require(film.has("cropHeight") ? "cropHeight" : "cropOffsetY", crop.y, crop.height, size.height);
}

FilmSize read_size(Properties& film) {
  constexpr std::int64_t kMaximumPixels = std::int64_t{1} << 28;
  const FilmSize size{film.integer("width", 768), film.integer("height", 576), {}, {}};
  if (size.width <= 0) film.fail("width", "must be positive");
  if (size.height <= 0) film.fail("height", "must be positive");
  if (std::int64_t{size.width} * size.height > kMaximumPixels)
    film.element().fail("a film of " + std::to_string(size.width) + " x " +
                        std::to_string(size.height) + " pixels is too large; the limit is " +
                        std::to_string(kMaximumPixels) + " pixels");
  return size;
}

/// The properties of an ldrfilm.
ToneMapping read_tone_mapping(Properties& film) {
  ToneMapping tones;
  const std::string method = film.choice("tonemapMethod", "gamma", {"gamma", "reinhard"});
  if (method == "reinhard") tones.op = ToneMapping::Operator::Reinhard;
  tones.exposure = film.number("exposure", 0.0);
  tones.key = film.positive("key", 0.18);
  tones.burn = film.non_negative("burn", 0.0);
  if (tones.burn > 1.0) film.fail("burn", "must be between 0 and 1");
  if (film.number("gamma", -1.0) != -1.0) tones.gamma = film.positive("gamma", 1.0);
  return tones;
}

/// Images have colours and nothing else, whatever the film asks for.
void note_pixel_format(Properties& film, LoadContext& context) {
  const std::string format = film.text("pixelFormat").value_or("rgb");
  if (lower_case(format) == "rgb") return;
  context.notice(
      *film.find("pixelFormat"),
      fmt::format("{} '{}' is not used: images have the channels R, G and B, and no alpha",
                  spelling("pixelFormat", film.dialect()), format));
}

/// True for what Mitsuba 0.6 writes into or beside the image: "label[10, 10]",
/// "metadata['author']".
bool is_annotation(const std::string& name) {
  std::string text;
  for (const std::string& part : split(lower_case(name), " \t\r\n")) text += part;
  return (text.starts_with("label[") && text.ends_with("]")) ||
         (text.starts_with("metadata['") && text.ends_with("']"));
}

void note_annotations(Properties& film, LoadContext& context) {
  const std::vector<std::string> names = film.ignore_if(&is_annotation);
  if (!names.empty())
    context.notice(film.element(), "annotations of the film are not written: " + join(names));
}

FilmSize read_film(const Element& element, LoadContext& context) {
  Properties film(element);
  const std::array<std::pair<std::string_view, bool>, 2> kinds{
      {{"hdrfilm", false}, {"ldrfilm", true}}};
  const bool tone_mapped = find_plugin(kinds, film);
  FilmSize size = read_size(film);
  read_crop(film, size);
  size.filter = read_filter(film);
  note_pixel_format(film, context);
  if (film.dialect() == Dialect::Mitsuba06) note_annotations(film, context);
  film.ignore({"fileFormat", "componentFormat", "channelNames", "banner", "attachLog",
               "highQualityEdges", "filename", "sampleBorder", "compensate"});
  if (tone_mapped) context.tone_mapping = read_tone_mapping(film);
  film.finish();
  return size;
}

/// A sensor without a film has an hdrfilm with all defaults, as in Mitsuba.
FilmSize read_film_of(Properties& sensor, LoadContext& context) {
  const std::vector<Element> films = sensor.nested({"film"});
  if (films.size() > 1) films.back().fail("a second film of the sensor");
  if (!films.empty()) return read_film(films[0], context);
  FilmSize size;
  size.filter = default_filter();
  size.crop = {0, 0, size.width, size.height};
  return size;
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

/// Mitsuba's cameras look along +z with +y up, which leaves +x on the left of the image. Returns
/// the lengths of these axes in the world.
Vec3d place(Camera& camera, Properties& sensor) {
  const Eigen::Affine3d to_world = sensor.transform("toWorld");
  const Eigen::Matrix3d axes = to_world.linear();
  const Vec3d lengths = axes.colwise().norm().transpose();
  if (!(lengths.minCoeff() > 0.0)) sensor.fail("toWorld", "has no inverse");
  camera.origin = to_world.translation();
  camera.right = -axes.col(0) / lengths.x();
  camera.up = axes.col(1) / lengths.y();
  camera.forward = axes.col(2) / lengths.z();
  const Eigen::Matrix3d rotation = axes * lengths.cwiseInverse().asDiagonal();
  if (!(rotation * rotation.transpose()).isIdentity(1e-3))
    sensor.fail("toWorld", "the transform of a sensor must not shear");
  return lengths;
}

/// Narrows the camera from the whole film to its window.
void crop(Camera& camera, const FilmSize& film) {
  const FilmSize::Crop& window = film.crop;
  camera.film_width = window.width;
  camera.film_height = window.height;
  if (window.width == film.width && window.height == film.height) return;
  const double width = 2.0 * camera.half_width / film.width;  // of a pixel
  const double height = 2.0 * camera.half_height / film.height;
  camera.center.x() += (window.x + 0.5 * (window.width - film.width)) * width;
  camera.center.y() -= (window.y + 0.5 * (window.height - film.height)) * height;
  camera.half_width = 0.5 * window.width * width;
  camera.half_height = 0.5 * window.height * height;
}

/// Shifts the window of the film, in units of the whole film: a film point shows what is at the
/// point plus the offset without.
void shift(Camera& camera, Properties& sensor) {
  camera.center.x() = 2.0 * camera.half_width * sensor.number("principalPointOffsetX", 0.0);
  camera.center.y() = -2.0 * camera.half_height * sensor.number("principalPointOffsetY", 0.0);
}

/// How many samples a pixel gets is up to the command line, unless it does not say. Numbers are
/// drawn by the integrators.
void read_sampler(const Element& element, LoadContext& context) {
  Properties sampler(element);
  if (sampler.has("sampleCount")) {
    context.sample_count = sampler.integer("sampleCount", 4);
    if (*context.sample_count < 1) sampler.fail("sampleCount", "must be positive");
  }
  sampler.ignore({"seed", "scramble", "dimension", "jitter"});
  sampler.finish();
  if (sampler.type() != "independent")
    context.notice(element, sampler.description() + " is not used: samples are independent");
}

void read_clips(Camera& camera, Properties& sensor) {
  camera.near_clip = sensor.positive("nearClip", 1e-2);
  camera.far_clip = sensor.positive("farClip", 1e4);
  if (!(camera.near_clip < camera.far_clip))
    sensor.fail("nearClip", "must be smaller than 'farClip'");
}

Camera read_perspective(Properties& sensor, const FilmSize& film) {
  const double aspect = static_cast<double>(film.width) / film.height;
  Camera camera;
  const Vec3d lengths = place(camera, sensor);
  if (!lengths.isOnes(1e-3))
    sensor.fail("toWorld", "the transform of a perspective sensor must not scale");
  camera.half_width = read_half_width(sensor, aspect);
  camera.half_height = camera.half_width / aspect;
  shift(camera, sensor);
  read_clips(camera, sensor);
  return camera;
}

/// In focus at the far plane unless it says where, as in Mitsuba.
Camera read_thin_lens(Properties& sensor, const FilmSize& film) {
  Camera camera = read_perspective(sensor, film);
  if (!sensor.has("apertureRadius"))
    sensor.element().fail(sensor.description() + " needs an " +
                          spelling("apertureRadius", sensor.dialect()));
  camera.lens_radius = sensor.non_negative("apertureRadius", 0.0);
  camera.focus_depth = sensor.positive("focusDistance", camera.far_clip);
  return camera;
}

/// The film is [-1, 1] wide in the sensor's own frame, and as high as its aspect wants.
Camera read_orthographic(Properties& sensor, const FilmSize& film) {
  Camera camera;
  camera.projection = Camera::Projection::Orthographic;
  const Vec3d lengths = place(camera, sensor);
  // The image plane at distance 1 is as wide as that of a pinhole with some 50 degrees.
  camera.half_width = 0.5;
  camera.scale = 2.0 * lengths.x();
  camera.half_height = lengths.y() * film.height / film.width / camera.scale;
  read_clips(camera, sensor);
  // In Mitsuba 3 rays start on the near plane, which a scale moves.
  if (sensor.dialect() == Dialect::Mitsuba3) {
    const double moved = camera.near_clip * (lengths.z() - 1.0);
    camera.near_clip += moved;
    camera.far_clip += moved;
  }
  return camera;
}

using SensorReader = Camera (*)(Properties&, const FilmSize&);
constexpr std::array<std::pair<std::string_view, SensorReader>, 3> kSensors{
    {{"perspective", &read_perspective},
     {"thinlens", &read_thin_lens},
     {"orthographic", &read_orthographic}}};

}  // namespace

Camera read_sensor(const Element& element, LoadContext& context) {
  Properties properties(element);
  const SensorReader read = find_plugin(kSensors, properties);
  const FilmSize film = read_film_of(properties, context);
  Camera camera = read(properties, film);
  camera.filter = film.filter;
  crop(camera, film);
  // The others have no focus, and nothing here moves.
  properties.ignore({"focusDistance", "shutterOpen", "shutterClose"});
  for (const Element& sampler : properties.nested({"sampler"})) read_sampler(sampler, context);
  properties.finish();
  context.objects.define(element, NamedObjects::Other{});
  return camera;
}

}  // namespace driftlight
