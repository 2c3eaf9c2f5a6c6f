// SPDX-License-Identifier: Apache-2.0
#include "relief_xml.h"

#include <fmt/format.h>

#include <utility>

#include "bsdfs_xml.h"
#include "textures_xml.h"
#include "vertex_colors.h"

namespace driftlight {
namespace {

bool is_texture(const Element& element, LoadContext& context) {
  if (element.tag() != "ref") return element.tag() == "texture";
  context.objects.read_ahead(element, "texture",
                             [&](const Element& target) { read_texture(target, context); });
  context.objects.read_ahead(element, "bsdf",
                             [&](const Element& target) { read_surface(target, context); });
  return context.objects.names<Texture>(element);
}

/// The nested bsdf, with this relief but for its texture.
Surface read_relief(Properties& properties, LoadContext& context, Relief relief) {
  std::optional<Texture> texture;
  std::shared_ptr<Surface> nested;
  for (const Element& element : properties.nested({"texture", "bsdf", "ref"})) {
    if (is_texture(element, context)) {
      if (texture) element.fail("a second texture of " + properties.description());
      texture = read_texture(element, context);
    } else {
      if (nested) element.fail("a second nested bsdf of " + properties.description());
      nested = read_surface(element, context);
    }
  }
  if (!texture || !nested)
    properties.element().fail(properties.description() + " needs a texture and a nested bsdf");
  if (nested->relief)
    properties.element().fail("bump and normal maps cannot be nested in each other");
  if (context.assumed_srgb.contains(texture->bitmap))
    context.notice(
        properties.element(),
        fmt::format("the image of {} is decoded as sRGB, as nothing else is asked for; {} "
                    "takes its values as they are, which most such images want",
                    properties.description(),
                    properties.dialect() == Dialect::Mitsuba3 ? "the boolean 'raw' as true"
                                                              : "the float 'gamma' as 1"));
  if (is_vertex_colors(*texture))
    properties.element().fail("vertex colours cannot be a bump or normal map");
  relief.texture = *texture;
  Surface result = *nested;
  result.material.reset();
  result.relief = std::make_shared<const Relief>(std::move(relief));
  return result;
}

/// What Mitsuba 3 does unless it is told otherwise, Mitsuba 0.6 never, and we do not.
void note_invalid_normals(Properties& properties, LoadContext& context) {
  const bool newer = properties.dialect() == Dialect::Mitsuba3;
  const bool flips = properties.boolean("flipInvalidNormals", newer);
  const bool shadows = properties.boolean("useShadowingFunction", newer);
  const auto name = [&](std::string_view camel) { return spelling(camel, properties.dialect()); };
  if (flips)
    context.notice(properties.element(),
                   fmt::format("{} is black where its normals face away from the viewer: '{}' is "
                               "not supported",
                               properties.description(), name("flipInvalidNormals")));
  if (shadows)
    context.notice(properties.element(),
                   fmt::format("grazing light on the slopes of {} is not dimmed: '{}' is not "
                               "supported",
                               properties.description(), name("useShadowingFunction")));
}

}  // namespace

Surface read_bump_map(Properties& properties, LoadContext& context) {
  const double scale = properties.number("scale", 1.0);
  note_invalid_normals(properties, context);
  return read_relief(properties, context, {Relief::Kind::Bumps, {}, scale});
}

Surface read_normal_map(Properties& properties, LoadContext& context) {
  note_invalid_normals(properties, context);
  return read_relief(properties, context, {Relief::Kind::Normals, {}, 1.0});
}

}  // namespace driftlight
