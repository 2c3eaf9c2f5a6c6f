// SPDX-License-Identifier: Apache-2.0
#include "textures_xml.h"

#include <array>

namespace driftlight {
namespace {

void check_filter(Properties& properties, LoadContext& context) {
  const std::string filter =
      properties.choice("filterType", "ewa", {"ewa", "trilinear", "bilinear"});
  if (filter == "bilinear") return;
  context.notice(properties.element(),
                 "filter '" + filter + "' is not used: textures are filtered bilinearly");
}

void check_wrapping(Properties& properties) {
  for (const std::string_view name : {"wrapMode", "wrapModeU", "wrapModeV"})
    properties.choice(name, "repeat", {"repeat"});
}

Texture read_bitmap_texture(Properties& properties, LoadContext& context) {
  Texture texture;
  const std::string file = properties.required_text("filename");
  const std::optional<Gamma> gamma = read_gamma(properties);
  texture.bitmap = with_location(properties.element(), [&] {
    return std::make_shared<const Bitmap>(read_bitmap(properties.element().find_file(file), gamma));
  });
  const double both = properties.number("uvscale", 1.0);
  texture.uv_scale = {properties.number("uscale", both), properties.number("vscale", both)};
  texture.uv_offset = {properties.number("uoffset", 0.0), properties.number("voffset", 0.0)};
  check_filter(properties, context);
  check_wrapping(properties);
  properties.ignore({"cache", "maxAnisotropy"});
  return texture;
}

using TextureReader = Texture (*)(Properties&, LoadContext&);
constexpr std::array<std::pair<std::string_view, TextureReader>, 1> kTextures{
    {{"bitmap", &read_bitmap_texture}}};

}  // namespace

std::optional<Gamma> read_gamma(Properties& properties) {
  const double gamma = properties.number("gamma", 0.0);
  if (gamma == 0.0) return std::nullopt;
  if (gamma == -1.0) return Gamma(std::nullopt);
  return Gamma(properties.positive("gamma", 1.0));
}

Texture read_texture(const Element& element, LoadContext& context) {
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
  if (child && child->tag() == "texture") return read_texture(*child, context);
  if (child && child->tag() == "ref") {
    context.objects.read_ahead(*child, "texture",
                               [&](const Element& target) { read_texture(target, context); });
    return context.objects.resolve<Texture>(*child, "texture");
  }
  return Texture(properties.color(name, fallback));
}

Rgbd maximum_color(const Texture& texture) {
  if (texture.is_constant()) return texture.color;
  Eigen::Array3f maximum = Eigen::Array3f::Zero();
  for (const Eigen::Array3f& texel : texture.bitmap->texels) maximum = maximum.max(texel);
  return texture.scale * maximum.cast<double>();
}

void scale(Texture& texture, double factor) {
  texture.color *= factor;
  texture.scale *= factor;
}

}  // namespace driftlight
