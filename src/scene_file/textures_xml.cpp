// SPDX-License-Identifier: Apache-2.0
#include "textures_xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "color_xml.h"
#include "vertex_colors.h"

namespace driftlight {
namespace {

/// The place of uv on the texture: in Mitsuba 0.6 by scales and offsets, in Mitsuba 3 by a
/// transform.
void read_mapping(Properties& properties, Texture& texture) {
  const Eigen::Affine3d to_uv = properties.transform("toUV");
  texture.uv_to_texture = to_uv.linear().topLeftCorner<2, 2>();
  texture.uv_offset = to_uv.translation().head<2>();
  if (properties.has("toUV")) return;
  const double both = properties.number("uvscale", 1.0);
  texture.uv_to_texture =
      Vec2d(properties.number("uscale", both), properties.number("vscale", both)).asDiagonal();
  texture.uv_offset = {properties.number("uoffset", 0.0), properties.number("voffset", 0.0)};
  properties.choice("coordinates", "uv", {"uv"});
}

void read_filter_type(Properties& properties, Texture& texture, LoadContext& context) {
  const bool newer = properties.dialect() == Dialect::Mitsuba3;
  const std::string filter = properties.choice("filterType", newer ? "bilinear" : "ewa",
                                               {"ewa", "trilinear", "bilinear", "nearest"});
  texture.interpolates = filter != "nearest";
  if (filter == "ewa" || filter == "trilinear")
    context.notice(properties.element(),
                   "filter '" + filter + "' is not used: textures are filtered bilinearly");
}

Wrap read_wrap(Properties& properties, std::string_view name, const std::string& fallback) {
  const std::string mode =
      properties.choice(name, fallback, {"repeat", "clamp", "mirror", "zero", "one"});
  if (mode == "clamp") return Wrap::Clamp;
  if (mode == "mirror") return Wrap::Mirror;
  if (mode == "zero") return Wrap::Zero;
  return mode == "one" ? Wrap::One : Wrap::Repeat;
}

Texture read_bitmap_texture(Properties& properties, LoadContext& context) {
  Texture texture;
  const std::string file = properties.required_text("filename");
  std::optional<Gamma> gamma = read_gamma(properties);
  if (properties.boolean("raw", false)) gamma = 1.0;
  ImageFile image = with_location(properties.element(), [&] {
    return read_image_file(properties.element().find_file(file), gamma);
  });
  texture.bitmap = std::make_shared<const Bitmap>(std::move(image.bitmap));
  if (!gamma && !image.gamma) context.assumed_srgb.insert(texture.bitmap);
  read_mapping(properties, texture);
  read_filter_type(properties, texture, context);
  const std::string both = properties.text("wrapMode").value_or("repeat");
  texture.wrap_u = read_wrap(properties, "wrapMode", "repeat");
  texture.wrap_u = read_wrap(properties, "wrapModeU", both);
  texture.wrap_v = read_wrap(properties, "wrapModeV", both);
  properties.ignore({"cache", "maxAnisotropy", "accel", "format"});
  return texture;
}

Texture read_pattern(Properties& properties, TwoColors pattern) {
  Texture texture;
  pattern.color0 = properties.color("color0", pattern.color0);
  pattern.color1 = properties.color("color1", pattern.color1);
  texture.pattern = pattern;
  read_mapping(properties, texture);
  return texture;
}

Texture read_checkerboard(Properties& properties, LoadContext&) {
  return read_pattern(
      properties, {TwoColors::Layout::Checkerboard, Rgbd::Constant(0.4), Rgbd::Constant(0.2), 0.0});
}

Texture read_grid(Properties& properties, LoadContext&) {
  const double width = properties.non_negative("lineWidth", 0.01);
  return read_pattern(properties,
                      {TwoColors::Layout::Grid, Rgbd::Constant(0.2), Rgbd::Constant(0.4), width});
}

/// A texture or colour, times a factor.
Texture read_scaled(Properties& properties, LoadContext& context) {
  const std::optional<Element> factor = properties.find("scale");
  const bool is_number = factor && (factor->tag() == "float" || factor->tag() == "integer");
  const Rgbd by = is_number ? Rgbd::Constant(properties.non_negative("scale", 1.0))
                            : properties.color("scale", kWhite);
  std::optional<Texture> texture;
  if (properties.has("value")) texture = Texture(properties.color("value", kWhite));
  for (const Element& nested : properties.nested({"texture", "ref"})) {
    if (texture) nested.fail("a second texture to scale");
    texture = read_texture(nested, context);
  }
  if (!texture) properties.element().fail("texture 'scale' needs a texture or a 'value' to scale");
  scale(*texture, by);
  return *texture;
}

/// The colours of the mesh's vertices, in Mitsuba 0.6.
Texture read_vertex_colors(Properties&, LoadContext&) { return vertex_color_texture(); }

/// Likewise in Mitsuba 3, where meshes can have more.
Texture read_mesh_attribute(Properties& properties, LoadContext&) {
  properties.required_text("name");
  properties.choice("name", "", {"vertex_color"});
  Texture texture = vertex_color_texture();
  scale(texture, Rgbd::Constant(properties.non_negative("scale", 1.0)));
  return texture;
}

using TextureReader = Texture (*)(Properties&, LoadContext&);
constexpr std::array<std::pair<std::string_view, TextureReader>, 6> kTextures{{
    {"bitmap", &read_bitmap_texture},
    {"checkerboard", &read_checkerboard},
    {"gridtexture", &read_grid},
    {"scale", &read_scaled},
    {"vertexcolors", &read_vertex_colors},
    {"mesh_attribute", &read_mesh_attribute},
}};

}  // namespace

std::optional<Gamma> read_gamma(Properties& properties) {
  const double gamma = properties.number("gamma", 0.0);
  if (gamma == 0.0) return std::nullopt;
  if (gamma == -1.0) return Gamma(std::nullopt);
  return Gamma(properties.positive("gamma", 1.0));
}

Texture read_texture(const Element& element, LoadContext& context) {
  if (element.tag() == "ref") {
    context.objects.read_ahead(element, "texture",
                               [&](const Element& target) { read_texture(target, context); });
    return context.objects.resolve<Texture>(element, "texture");
  }
  if (const auto* read = context.objects.find_read<Texture>(element)) return *read;
  Properties properties(element);
  Texture texture = find_plugin(kTextures, properties)(properties, context);
  properties.finish();
  context.objects.define(element, texture);
  return texture;
}

Texture read_textured(Properties& properties, std::string_view name, const Rgbd& fallback,
                      LoadContext& context) {
  const auto child = properties.find(name);
  if (child && (child->tag() == "texture" || child->tag() == "ref"))
    return read_texture(*child, context);
  return Texture(properties.color(name, fallback));
}

Texture read_scalar(Properties& properties, std::string_view name, double fallback,
                    LoadContext& context) {
  const std::optional<Element> child = properties.find(name);
  if (child && child->tag() == "float")
    return Texture(Rgbd::Constant(properties.non_negative(name, fallback)));
  return read_textured(properties, name, Rgbd::Constant(fallback), context);
}

Texture read_share(Properties& properties, std::string_view name, double fallback,
                   LoadContext& context) {
  Texture texture = read_scalar(properties, name, fallback, context);
  if (is_vertex_colors(texture))
    properties.fail(name, "must be one number, which vertex colours are not");
  const bool newer = properties.dialect() == Dialect::Mitsuba3;
  const Rgbd factors = newer ? kLuminance : Rgbd::Constant(1.0 / 3.0);
  double largest = 0;
  const auto gray = [&](const Rgbd& color) {
    const double share = (factors * color).sum();
    largest = std::max(largest, share);
    return Rgbd(Rgbd::Constant(std::min(share, 1.0)));
  };
  if (texture.is_constant()) texture.color = gray(texture.color);
  if (texture.pattern) {
    texture.pattern->color0 = gray(texture.scale * texture.pattern->color0);
    texture.pattern->color1 = gray(texture.scale * texture.pattern->color1);
  }
  if (texture.bitmap != nullptr) {
    Bitmap bitmap = *texture.bitmap;
    for (Eigen::Array3f& texel : bitmap.texels)
      texel = gray(texture.scale * texel.cast<double>()).cast<float>();
    texture.bitmap = std::make_shared<const Bitmap>(std::move(bitmap));
  }
  texture.scale = kWhite;
  constexpr double kRounding = 1e-6;
  if (largest > 1.0 + kRounding)
    context.notice(properties.element(),
                   fmt::format("'{}' of {} exceeds 1 and is taken as 1 there, as in Mitsuba",
                               spelling(name, properties.dialect()), properties.description()));
  return texture;
}

void scale(Texture& texture, const Rgbd& factor) {
  texture.color *= factor;
  texture.scale *= factor;
}

}  // namespace driftlight
