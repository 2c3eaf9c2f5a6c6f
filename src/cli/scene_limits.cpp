// SPDX-License-Identifier: Apache-2.0
#include "cli/scene_limits.h"

#include <algorithm>
#include <set>
#include <variant>

namespace driftlight::cli {
namespace {

template <class T>
std::size_t bytes(const std::vector<T>& values) {
  return values.size() * sizeof(T);
}

/// True if light goes on by a delta lobe somewhere, other than straight.
bool has_smooth_surface(const Scene& scene) {
  return std::any_of(scene.bsdfs().begin(), scene.bsdfs().end(), [](const Bsdf& bsdf) {
    return has_delta(bsdf, Scattering::Reflection) ||
           (has_delta(bsdf, Scattering::Transmission) && delta_eta(bsdf) != 1.0);
  });
}

bool has_unhittable_emitter(const Scene& scene) {
  return std::any_of(scene.emitters().begin(), scene.emitters().end(), [](const Emitter& emitter) {
    return is_point(emitter) || std::holds_alternative<DirectionalEmitter>(emitter);
  });
}

}  // namespace

std::size_t memory_of(const Scene& scene) {
  std::size_t sum = 0;
  for (const Shape& shape : scene.shapes())
    if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry))
      sum +=
          bytes(mesh->positions) + bytes(mesh->normals) + bytes(mesh->uvs) + bytes(mesh->triangles);
  std::set<const Bitmap*> bitmaps;
  for_each_texture(scene, [&](const Texture& texture) { bitmaps.insert(texture.bitmap.get()); });
  for (const Emitter& emitter : scene.emitters())
    if (const auto* map = std::get_if<EnvironmentMap>(&emitter)) bitmaps.insert(&map->bitmap());
  for (const Bitmap* bitmap : bitmaps)
    if (bitmap != nullptr) sum += bytes(bitmap->texels);
  return sum;
}

std::vector<IntegratorLimits> limits_of(const Scene& scene) {
  const Camera& camera = scene.camera();
  const bool is_pinhole = !camera.has_lens() && !camera.is_orthographic();
  const bool is_smooth = has_smooth_surface(scene);
  const bool is_unhittable = is_smooth && has_unhittable_emitter(scene);
  const auto text = [&](Integrator integrator) -> std::string {
    const bool by_perturbations = integrator == Integrator::Mlt || integrator == Integrator::Erpt;
    if (by_perturbations && !is_pinhole) return "nothing: it needs a pinhole";
    if (integrator == Integrator::Light && is_smooth)
      return "all but what is seen by way of smooth mirrors and glass";
    if (!is_unhittable) return "all";
    if (integrator == Integrator::Path)
      return "all but light of point, spot and directional emitters by way of smooth mirrors and "
             "glass";
    return "all but light of point, spot and directional emitters by way of smooth mirrors and "
           "glass that is seen by way of such";
  };
  std::vector<IntegratorLimits> result;
  for (const Integrator integrator :
       {Integrator::Langevin, Integrator::Pssmlt, Integrator::Mmlt, Integrator::H2mc,
        Integrator::Lmc, Integrator::Mlt, Integrator::Erpt, Integrator::Path, Integrator::Bdpt,
        Integrator::Light})
    result.push_back({integrator, text(integrator)});
  return result;
}

}  // namespace driftlight::cli
