// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <string>
#include <utility>

#include "bsdf_textures.h"
#include "driftlight/error.h"
#include "driftlight/scene.h"
#include "shape_extent.h"

namespace driftlight {
namespace {

/// False if uv are not one linear function over the plane of the mesh.
bool has_linear_uv(const TriangleMesh& mesh) {
  constexpr double kTolerance = 1e-4;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::array<Vec3d, 3> corner = corners(mesh, i);
    for (int j = 0; j < 3; ++j) {
      const Vec2d own = triangle_uv<double>(mesh, i, j == 1 ? 1.0 : 0.0, j == 2 ? 1.0 : 0.0);
      const Vec2d first = triangle_uv(mesh, 0, corner[static_cast<std::size_t>(j)]);
      if (!((own - first).cwiseAbs().maxCoeff() <= kTolerance)) return false;
    }
  }
  return true;
}

DiscreteDistribution triangles_by_area(const TriangleMesh& mesh) {
  std::vector<double> areas;
  areas.reserve(mesh.triangles.size());
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::array<Vec3d, 3> p = corners(mesh, i);
    areas.push_back(0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm());
  }
  return DiscreteDistribution(areas);
}

std::shared_ptr<const Texture> divided(const Texture& texture, const Rgbd& by) {
  auto result = std::make_shared<Texture>(texture);
  result->scale *= (by > 0.0).select(1.0 / by, 1.0);
  return result;
}

}  // namespace

std::uint32_t SceneBuilder::add_bsdf(Bsdf bsdf) {
  if (lobe_count(bsdf) > kMaxLobes)
    throw InputError("a bsdf of " + std::to_string(lobe_count(bsdf)) + " lobes; the limit is " +
                     std::to_string(kMaxLobes));
  scene_.bsdfs_.push_back(std::move(bsdf));
  return static_cast<std::uint32_t>(scene_.bsdfs_.size() - 1);
}

std::uint32_t SceneBuilder::add_material(const Material& material) {
  scene_.surfaces_->materials.push_back(material);
  return static_cast<std::uint32_t>(scene_.surfaces_->materials.size() - 1);
}

std::uint32_t SceneBuilder::add_shape(Geometry geometry, std::uint32_t material,
                                      const Texture& radiance) {
  const Rgbd mean = radiance.average();
  const Rgbd unit = (mean > 0.0).select(mean, radiance.maximum_color());
  const std::uint32_t index = add_shape(std::move(geometry), material, unit);
  if (!radiance.is_constant())
    std::get<AreaEmitter>(scene_.emitters_.back()).texture = divided(radiance, unit);
  return index;
}

std::uint32_t SceneBuilder::add_shape(Geometry geometry, std::uint32_t material,
                                      std::optional<Rgbd> radiance) {
  if (const auto* mesh = std::get_if<TriangleMesh>(&geometry)) {
    if (mesh->triangles.empty()) throw InputError("a mesh without triangles");
    for (const auto& triangle : mesh->triangles)
      for (const std::uint32_t i : triangle)
        if (i >= mesh->positions.size())
          throw InputError("a triangle's vertex index " + std::to_string(i) +
                           " is beyond the mesh's " + std::to_string(mesh->positions.size()) +
                           " vertices");
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&geometry)) {
    // The extent of one that is thinner or flatter has fewer dimensions than its surface.
    const double slenderness = cylinder->length / cylinder->radius;
    if (radiance && !(slenderness > 1e-4 && slenderness < 1e4))
      throw InputError(
          "an emitting cylinder must not be more than 10000 times as long as its "
          "radius, nor the reverse");
  }
  const std::shared_ptr<const Relief>& relief = scene_.surfaces_->materials.at(material).relief;
  if (relief != nullptr) {
    const auto* mesh = std::get_if<TriangleMesh>(&geometry);
    if (mesh == nullptr || mesh->uvs.empty())
      throw InputError("bump and normal maps need a mesh with texture coordinates");
  }
  const auto index = static_cast<std::uint32_t>(scene_.surfaces_->shapes.size());
  Shape shape;
  shape.relief = relief;
  shape.geometry = std::move(geometry);
  shape.material = material;
  if (radiance) {
    shape.emitter = static_cast<std::uint32_t>(scene_.emitters_.size());
    scene_.emitters_.emplace_back(AreaEmitter{*radiance, index, nullptr});
  }
  scene_.surfaces_->shapes.push_back(std::move(shape));
  return index;
}

void SceneBuilder::add_emitter(PointEmitter emitter) { scene_.emitters_.emplace_back(emitter); }
void SceneBuilder::add_emitter(SpotEmitter emitter) { scene_.emitters_.emplace_back(emitter); }
void SceneBuilder::add_emitter(DirectionalEmitter emitter) {
  scene_.emitters_.emplace_back(emitter);
}

void SceneBuilder::set_environment(Emitter environment) {
  if (scene_.environment_) throw InputError("a scene can have one environment emitter only");
  scene_.environment_ = static_cast<std::uint32_t>(scene_.emitters_.size());
  scene_.emitters_.push_back(std::move(environment));
}

void SceneBuilder::set_camera(const Camera& camera) { scene_.camera_ = camera; }

Scene SceneBuilder::build() {
  Scene& scene = scene_;
  if (scene.emitters_.empty()) throw InputError("the scene has no emitter");
  Eigen::AlignedBox3d box;
  for (Shape& shape : scene.surfaces_->shapes) {
    shape.extent = extent_of(shape.geometry);
    const Material& material = scene.surfaces_->materials.at(shape.material);
    shape.textured = shape.relief != nullptr || is_textured(scene.bsdfs_.at(material.front)) ||
                     (material.back && is_textured(scene.bsdfs_.at(*material.back)));
    shape.anisotropic = !is_isotropic(scene.bsdfs_.at(material.front)) ||
                        (material.back && !is_isotropic(scene.bsdfs_.at(*material.back)));
    if (shape.emitter) {
      const bool emits_texture =
          std::get<AreaEmitter>(scene.emitters_[*shape.emitter]).texture != nullptr;
      shape.textured |= emits_texture;
      if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry)) {
        shape.triangles = triangles_by_area(*mesh);
        shape.bent_emission = emits_texture && !has_linear_uv(*mesh);
      }
    }
    box.extend(std::visit([](const auto& s) { return bounds_of(s); }, shape.geometry));
  }
  for (const Emitter& emitter : scene.emitters_)
    if (is_point(emitter)) box.extend(position_of(emitter));
  if (!box.isEmpty()) {
    scene.center_ = box.center();
    scene.radius_ = 0.5 * box.diagonal().norm();
  }
  scene.choose_emitters_by_power();
  if (!scene.samples_emitters()) throw InputError("all emitters of the scene are black");

  // User geometries point into the shapes, which do not move from here on.
  scene.accelerator_ = Scene::accelerate(scene.surfaces_->shapes);
  return std::move(scene_);
}

}  // namespace driftlight
