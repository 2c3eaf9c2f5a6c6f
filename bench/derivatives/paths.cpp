// SPDX-License-Identifier: Apache-2.0
#include "derivatives/paths.h"

#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>
#include <variant>

#include "driftlight/contribution.h"
#include "driftlight/factor.h"
#include "driftlight/path_sampler.h"

namespace driftlight::bench {
namespace {

/// Few enough to stay in the cache, as the path of a chain does.
constexpr std::size_t kPathsPerLength = 32;

/// Two triangles from `corner` along u and v, with normal along u x v.
TriangleMesh quad(const Vec3d& corner, const Vec3d& u, const Vec3d& v) {
  TriangleMesh mesh;
  for (const Vec3d& p : {corner, Vec3d(corner + u), Vec3d(corner + u + v), Vec3d(corner + v)})
    mesh.positions.push_back(p.cast<float>());
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// The walls of [-1, 1]^3 but for the floor, with their normals inward or outward.
void add_walls(SceneBuilder& builder, std::uint32_t material, bool inward) {
  const auto wall = [&](const Vec3d& corner, const Vec3d& u, const Vec3d& v) {
    builder.add_shape(inward ? quad(corner, u, v) : quad(corner, v, u), material);
  };
  const Vec3d x(2, 0, 0);
  const Vec3d y(0, 2, 0);
  const Vec3d z(0, 0, 2);
  wall({-1, 1, -1}, x, z);
  wall({-1, -1, -1}, y, z);
  wall({1, -1, -1}, z, y);
  wall({-1, -1, -1}, x, y);
  wall({-1, -1, 1}, y, x);
}

void add_floor(SceneBuilder& builder, std::uint32_t material, bool inward) {
  const Vec3d x(2, 0, 0);
  const Vec3d z(0, 0, 2);
  builder.add_shape(inward ? quad({-1, -1, -1}, z, x) : quad({-1, -1, -1}, x, z), material);
}

/// A lamp below the ceiling, and a camera that looks down the room.
Scene furnish(SceneBuilder builder) {
  const auto black = builder.add_bsdf(Diffuse{Texture(Rgbd::Zero())});
  builder.add_shape(quad({-0.4, 0.9, -0.4}, {0.8, 0, 0}, {0, 0, 0.8}),
                    builder.add_material({black, std::nullopt}), Rgbd(1.0, 0.9, 0.7));
  Camera camera;
  camera.origin = {0.05, 0.1, -0.9};
  camera.film_width = 64;
  camera.film_height = 64;
  builder.set_camera(camera);
  return builder.build();
}

Scene room(const Bsdf& walls, const Bsdf& floor, const Bsdf& sphere, bool inward) {
  SceneBuilder builder;
  const auto material = [&](const Bsdf& bsdf) {
    return builder.add_material({builder.add_bsdf(bsdf), std::nullopt});
  };
  add_walls(builder, material(walls), inward);
  add_floor(builder, material(floor), inward);
  const std::uint32_t round = material(sphere);
  builder.add_shape(Sphere{.center = {-0.45, -0.6, 0.3}, .radius = 0.35}, round);
  builder.add_shape(Sphere{.center = {0.5, -0.2, 0.1}, .radius = 0.3}, round);
  return furnish(std::move(builder));
}

Scene diffuse_room() {
  const Diffuse walls{Texture(Rgbd(0.7, 0.6, 0.5))};
  return room(walls, walls, Diffuse{Texture(Rgbd(0.3, 0.5, 0.8))}, true);
}

Scene glossy_room() {
  const Rgbd eta{0.2, 0.92, 1.1};
  const Rgbd k{3.9, 2.45, 2.14};
  const RoughConductor walls{{Distribution::Ggx, 0.2}, eta, k};
  return room(walls, walls, RoughConductor{{Distribution::Ggx, 0.1}, eta, k}, true);
}

/// A block of glass, seen from within.
Scene rough_glass_block() {
  const RoughDielectric walls{{Distribution::Ggx, 0.1}, 1.5};
  return room(walls, walls, RoughDielectric{{Distribution::Ggx, 0.1}, 1.0 / 1.5}, false);
}

Scene mirror_room() {
  return room(Conductor{}, Diffuse{Texture(Rgbd(0.7, 0.6, 0.5))}, Dielectric{1.5}, true);
}

/// Scattering vertices of a path whose BSDF is of one of these kinds.
template <class... Kinds>
int count(const Scene& scene, const PathTopology& topology) {
  int n = 0;
  for (int k = 0; k < topology.scatter_count; ++k) {
    const Hit& hit = topology.vertices[static_cast<std::size_t>(k)].hit;
    const Bsdf& bsdf = scene.bsdfs()[scene.materials()[scene.shapes()[hit.shape].material].front];
    if ((std::holds_alternative<Kinds>(bsdf) || ...)) ++n;
  }
  return n;
}

/// Draws paths until there are enough of each length that satisfy `belongs`.
PathClass draw(std::string name, Scene scene,
               const std::function<bool(const Scene&, const PathTopology&)>& belongs) {
  constexpr int kMaxAttempts = 50'000'000;
  PathClass result{std::move(name), std::move(scene), {}};
  const PathSampler sampler(result.scene, kMaxLength);
  Rng rng(1, Stream::Bootstrap, 0);
  int missing = kMaxLength - kMinLength + 1;
  for (int i = 0; i < kMaxAttempts && missing > 0; ++i) {
    const auto sample = sampler.sample(rng);
    if (!sample || sample->topology.length() < kMinLength) continue;
    auto& paths = result.paths[static_cast<std::size_t>(sample->topology.length())];
    if (paths.size() == kPathsPerLength || !belongs(result.scene, sample->topology)) continue;
    const PathTopology& topology = sample->topology;
    if (!std::isfinite(contribution(result.scene, topology, sample->coordinates).log_target))
      continue;
    PathState state{topology, sample->coordinates, {}, {}};
    state.chart = Chart(result.scene, topology, sample->coordinates);
    linearize(result.scene, topology, state.chart, DerivativeMethod::Hand, {}, state.linearization);
    if (RiccatiFactor(state.linearization).status() != RiccatiFactor::Status::Ok) continue;
    paths.push_back(state);
    if (paths.size() == kPathsPerLength) --missing;
  }
  if (missing > 0) throw std::runtime_error("too few paths of class " + result.name);
  return result;
}

}  // namespace

const std::vector<PathClass>& path_classes() {
  static const std::vector<PathClass> classes = [] {
    std::vector<PathClass> all;
    all.push_back(draw("diffuse", diffuse_room(), [](const auto& scene, const auto& path) {
      return count<Diffuse>(scene, path) == path.scatter_count;
    }));
    all.push_back(draw("glossy", glossy_room(), [](const auto& scene, const auto& path) {
      return count<RoughConductor>(scene, path) == path.scatter_count;
    }));
    all.push_back(draw("rough_glass", rough_glass_block(), [](const auto& scene, const auto& path) {
      return count<RoughDielectric>(scene, path) == path.scatter_count;
    }));
    all.push_back(draw("delta", mirror_room(), [](const auto& scene, const auto& path) {
      return count<Diffuse>(scene, path) == 1 &&
             count<Conductor, Dielectric>(scene, path) == path.scatter_count - 1;
    }));
    return all;
  }();
  return classes;
}

}  // namespace driftlight::bench
