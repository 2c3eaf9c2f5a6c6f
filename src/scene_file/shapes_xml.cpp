// SPDX-License-Identifier: Apache-2.0
#include "shapes_xml.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "bsdfs_xml.h"
#include "emitters_xml.h"
#include "properties.h"
#include "shape_readers.h"
#include "transform_geometry.h"
#include "vertex_colors.h"

namespace driftlight {
namespace {

/// More triangles than memory holds, in all instances together.
constexpr std::size_t kMaximumInstanced = std::size_t{1} << 28U;

/// A file of a few lines can ask for instances without end.
constexpr std::size_t kMaximumShapes = std::size_t{1} << 22U;

/// Those without a reader are made of other shapes.
constexpr std::array<std::pair<std::string_view, ShapeReader>, 10> kShapes{{
    {"rectangle", &read_rectangle},
    {"cube", &read_cube},
    {"sphere", &read_sphere},
    {"disk", &read_disk},
    {"cylinder", &read_cylinder},
    {"obj", &read_obj_shape},
    {"ply", &read_ply_shape},
    {"serialized", &read_serialized_shape},
    {"shapegroup", nullptr},
    {"instance", nullptr},
}};

Attachments read_attachments(Properties& properties, LoadContext& context) {
  Attachments result;
  for (const Element& element : properties.nested({"bsdf", "ref", "emitter"})) {
    if (is_area_emitter(element, context)) {
      if (result.radiance) element.fail("a second emitter of the shape");
      result.radiance = read_area_radiance(element, context);
      context.has_emitter = true;
      continue;
    }
    const std::string material = element.find("name").value_or("");
    if (properties.type() == "obj" && !material.empty() &&
        element.dialect() == Dialect::Mitsuba06) {
      result.by_material[material] = read_surface(element, context);
      continue;
    }
    if (result.surface) element.fail("a second bsdf of the shape");
    result.surface = read_surface(element, context);
  }
  return result;
}

/// Mitsuba's default: emitters are black, all else is a grey diffuse.
std::shared_ptr<Surface> default_surface(const Attachments& attachments) {
  const Rgbd reflectance = Rgbd::Constant(attachments.radiance ? 0.0 : 0.5);
  return std::make_shared<Surface>(
      Surface{Diffuse{Texture(reflectance)}, std::nullopt, std::nullopt});
}

/// A shape as its reader leaves it; all parts have a surface.
struct ShapeParts {
  std::vector<ShapePart> parts;
  std::optional<Texture> radiance;
};

ShapeParts read_parts(Properties& properties, LoadContext& context, ShapeReader reader) {
  Attachments attachments = read_attachments(properties, context);
  ShapeParts shape{reader(properties, context, attachments), attachments.radiance};
  properties.finish();
  const std::shared_ptr<Surface> common =
      attachments.surface ? attachments.surface : default_surface(attachments);
  for (ShapePart& part : shape.parts)
    if (!part.surface) part.surface = common;
  if (shape.radiance && shape.radiance->maximum() == 0.0) shape.radiance.reset();
  return shape;
}

void add_shape(const Element& element, ShapePart part, const std::optional<Texture>& radiance,
               LoadContext& context) {
  Geometry& geometry = part.geometry;
  auto* mesh = std::get_if<TriangleMesh>(&geometry);
  if (looks_at_vertex_colors(*part.surface)) {
    if (part.colors.empty())
      element.fail("the shape has no vertex colours, which a texture of its bsdf looks at");
    if (radiance && !radiance->is_constant())
      element.fail("vertex colours cannot be beside a textured radiance");
    part.surface = with_location(element, [&] {
      return std::make_shared<Surface>(painted(*mesh, part.colors, *part.surface));
    });
  }
  Surface& surface = *part.surface;
  const std::uint32_t material = material_index(surface, context);
  if (mesh != nullptr && mesh->uvs.empty() && !is_isotropic(surface))
    context.notice(element,
                   "without texture coordinates the roughness of alphaU lies along the first edge "
                   "of each triangle");
  with_location(element, [&] {
    if (radiance)
      context.builder.add_shape(std::move(geometry), material, *radiance);
    else
      context.builder.add_shape(std::move(geometry), material);
  });
  if (++context.shape_count > kMaximumShapes)
    element.fail(fmt::format("the scene has more than {} shapes", kMaximumShapes));
}

/// Shapes that appear only where instances of them do.
std::shared_ptr<const ShapeGroup> read_group(Properties& properties, LoadContext& context) {
  const auto group = std::make_shared<ShapeGroup>();
  for (const Element& element : properties.nested({"shape"})) {
    Properties nested(element);
    const ShapeReader reader = find_plugin(kShapes, nested);
    if (reader == nullptr) element.fail("instances and shapegroups cannot be nested");
    const ShapeParts shape = read_parts(nested, context, reader);
    if (shape.radiance) element.fail("an emitter cannot be part of a shapegroup");
    for (const ShapePart& part : shape.parts) {
      const auto* mesh = std::get_if<TriangleMesh>(&part.geometry);
      if (mesh != nullptr) group->triangles += mesh->triangles.size();
      group->parts.push_back(part);
    }
    context.objects.define(element, NamedObjects::Other{});
  }
  properties.finish();
  if (group->parts.empty()) properties.element().fail("a shapegroup without shapes");
  if (group->triangles > 0)
    context.notice(
        properties.element(),
        fmt::format("instances are copies: each of this shapegroup's takes the memory of "
                    "its {} triangles",
                    group->triangles));
  return group;
}

bool is_mirrored_texture(const ShapePart& part, const Eigen::Affine3d& to_world) {
  return std::holds_alternative<Disk>(part.geometry) && is_textured(*part.surface) &&
         to_world.linear().determinant() < 0.0;
}

void add_instance(Properties& properties, LoadContext& context) {
  const Element& element = properties.element();
  const std::vector<Element> refs = properties.nested({"ref"});
  if (refs.size() != 1) element.fail("an instance needs one <ref> to a shapegroup");
  context.objects.read_ahead(refs[0], "shape",
                             [&](const Element& target) { read_shape(target, context); });
  const auto group =
      context.objects.resolve<std::shared_ptr<const ShapeGroup>>(refs[0], "shapegroup");
  const Eigen::Affine3d to_world = properties.transform("toWorld");
  properties.finish();
  context.instanced_triangles += group->triangles;
  if (context.instanced_triangles > kMaximumInstanced)
    element.fail(
        fmt::format("the instances have more than {} triangles, each a copy", kMaximumInstanced));
  for (const ShapePart& part : group->parts) {
    if (is_mirrored_texture(part, to_world))
      properties.fail("toWorld", "a mirrored disk cannot carry a texture");
    std::visit(
        [&](const auto& shape) {
          auto placed = transformed(shape, to_world);
          if (!placed)
            properties.fail("toWorld",
                            "spheres must be scaled evenly, and cylinders across their axes");
          add_shape(element, {*std::move(placed), part.surface, part.colors}, std::nullopt,
                    context);
        },
        part.geometry);
  }
}

}  // namespace

void read_shape(const Element& element, LoadContext& context) {
  if (context.objects.is_read(element)) return;
  Properties properties(element);
  const ShapeReader reader = find_plugin(kShapes, properties);
  if (properties.type() == "shapegroup") {
    context.objects.define(element, read_group(properties, context));
    return;
  }
  if (reader == nullptr) {
    add_instance(properties, context);
  } else {
    ShapeParts shape = read_parts(properties, context, reader);
    for (ShapePart& part : shape.parts)
      add_shape(element, std::move(part), shape.radiance, context);
  }
  context.objects.define(element, NamedObjects::Other{});
}

}  // namespace driftlight
