// SPDX-License-Identifier: Apache-2.0
#include "support/test_scenes.h"

#include <algorithm>
#include <cmath>

#include "driftlight/contribution.h"

namespace driftlight::test {

// ---- Parts ------------------------------------------------------------------------------------

TriangleMesh quad(const Vec3d& corner, const Vec3d& u, const Vec3d& v, bool uvs, double bend) {
  TriangleMesh mesh;
  for (const Vec2d& s : {Vec2d(0, 0), Vec2d(1, 0), Vec2d(1, 1), Vec2d(0, 1)}) {
    mesh.positions.push_back((corner + s.x() * u + s.y() * v).cast<float>());
    if (uvs) mesh.uvs.push_back(s.cast<float>());
    if (bend != 0.0) {
      const Vec3d tilt =
          (2.0 * s.x() - 1.0) * u.normalized() + (2.0 * s.y() - 1.0) * v.normalized();
      const Vec3d n = u.cross(v).normalized() + bend * tilt;
      mesh.normals.push_back(n.normalized().cast<float>());
    }
  }
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

TriangleMesh round_mesh(const Vec3d& center, double radius, int rings, bool normals) {
  TriangleMesh mesh;
  const int sectors = 2 * rings;
  const auto index = [&](int ring, int sector) {
    return static_cast<std::uint32_t>(ring * sectors + sector % sectors);
  };
  for (int ring = 0; ring <= rings; ++ring) {
    for (int sector = 0; sector < sectors; ++sector) {
      const double theta = kPi * ring / rings;
      const double phi = 2.0 * kPi * sector / sectors;
      const Vec3d n(std::sin(theta) * std::cos(phi), std::cos(theta),
                    std::sin(theta) * std::sin(phi));
      mesh.positions.push_back((center + radius * n).cast<float>());
      if (normals) mesh.normals.push_back(n.cast<float>());
      mesh.uvs.emplace_back(static_cast<float>(sector) / static_cast<float>(sectors),
                            static_cast<float>(ring) / static_cast<float>(rings));
      if (ring == rings) continue;
      if (ring > 0)
        mesh.triangles.push_back(
            {index(ring, sector), index(ring, sector + 1), index(ring + 1, sector)});
      if (ring + 1 < rings)
        mesh.triangles.push_back(
            {index(ring, sector + 1), index(ring + 1, sector + 1), index(ring + 1, sector)});
    }
  }
  return mesh;
}

TriangleMesh box(const Vec3d& low, const Vec3d& high) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back(Vec3d((i & 1) != 0 ? high.x() : low.x(),
                                   (i & 2) != 0 ? high.y() : low.y(),
                                   (i & 4) != 0 ? high.z() : low.z())
                                 .cast<float>());
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

Camera look_at(const Vec3d& origin, const Vec3d& target, double half_width) {
  Camera camera;
  camera.origin = origin;
  camera.forward = (target - origin).normalized();
  camera.right = camera.forward.cross(Vec3d::UnitY()).normalized();
  camera.up = camera.right.cross(camera.forward);
  camera.half_width = half_width;
  camera.half_height = half_width;
  camera.film_width = 16;
  camera.film_height = 16;
  return camera;
}

std::shared_ptr<const Bitmap> pattern_bitmap(int width, int height, double low, double high) {
  auto bitmap = std::make_shared<Bitmap>();
  bitmap->width = width;
  bitmap->height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double a = std::sin(2.0 * kPi * x / width);
      const double b = std::cos(2.0 * kPi * y / height);
      const Rgbd c{0.5 + 0.5 * a * b, 0.5 + 0.5 * b, 0.5 + 0.25 * (a + b)};
      bitmap->texels.emplace_back((low + (high - low) * c).cast<float>());
    }
  }
  return bitmap;
}

Bitmap sun_bitmap(int width, int height, float sun) {
  Bitmap bitmap = *pattern_bitmap(width, height, 0.2, 1.0);
  const int y = height / 4;
  const int x = width / 3;
  for (const int i : {0, 1})
    for (const int j : {0, 1})
      bitmap.texels[static_cast<std::size_t>((y + j) * width + x + i)] *= sun;
  return bitmap;
}

Scene furnace(double albedo) {
  SceneBuilder builder;
  const auto white = builder.add_bsdf(Diffuse{Texture(Rgbd::Constant(albedo))});
  const auto material = builder.add_material({white, std::nullopt});
  Sphere sphere;
  sphere.center = {0.1, -0.2, 0.3};
  sphere.radius = 1.5;
  sphere.flip_normals = true;
  builder.add_shape(sphere, material, Rgbd::Ones());
  builder.set_camera(look_at({0.4, 0.2, -0.3}, {0, 0, 1}, 0.8));
  return builder.build();
}

// ---- Scenes -----------------------------------------------------------------------------------

namespace {

constexpr double kGlass = 1.5;
const Rgbd kGoldEta{0.143, 0.375, 1.442};
const Rgbd kGoldK{3.983, 2.386, 1.603};

Texture textured(int size, double low, double high) {
  Texture texture;
  texture.bitmap = pattern_bitmap(size, size, low, high);
  texture.uv_to_texture = Vec2d(2.0, 1.5).asDiagonal();
  texture.uv_offset = {0.13, 0.29};
  return texture;
}

Texture gray(double value) { return Texture(Rgbd{value, 0.9 * value, 0.8 * value}); }

Sphere sphere_at(const Vec3d& center, double radius) {
  Sphere sphere;
  sphere.center = center;
  sphere.radius = radius;
  return sphere;
}

/// A builder that makes a material of each BSDF it is given.
class Workshop {
 public:
  using ReliefPointer = std::shared_ptr<const Relief>;

  std::uint32_t one_sided(Bsdf bsdf, const ReliefPointer& relief = nullptr) {
    return builder_.add_material({builder_.add_bsdf(std::move(bsdf)), std::nullopt, relief});
  }
  std::uint32_t two_sided(Bsdf front, Bsdf back, const ReliefPointer& relief = nullptr) {
    const auto f = builder_.add_bsdf(std::move(front));
    return builder_.add_material({f, builder_.add_bsdf(std::move(back)), relief});
  }
  SceneBuilder* operator->() { return &builder_; }

 private:
  SceneBuilder builder_;
};

std::shared_ptr<const Relief> bumps(double scale) {
  return std::make_shared<const Relief>(Relief{Relief::Kind::Bumps, textured(8, 0.0, 1.0), scale});
}

/// A map of normals that are up to a fourth off the surface's.
std::shared_ptr<const Relief> tilts() {
  Bitmap bitmap = *pattern_bitmap(8, 8, 0.4, 0.6);
  for (Eigen::Array3f& texel : bitmap.texels) texel[2] = 0.9F;
  Texture texture = textured(8, 0.0, 1.0);
  texture.bitmap = std::make_shared<const Bitmap>(std::move(bitmap));
  return std::make_shared<const Relief>(Relief{Relief::Kind::Normals, texture, 1.0});
}

Microfacets beckmann(double alpha) { return {Distribution::Beckmann, alpha}; }
Microfacets ggx(double alpha) { return {Distribution::Ggx, alpha}; }
Microfacets beckmann(double along, double across) {
  return {Distribution::Beckmann, along, across};
}
Microfacets ggx(double along, double across) { return {Distribution::Ggx, along, across}; }

/// Walls of the room [-2, 2] x [0, 3] x [-2, 2], seen from its front.
void add_walls(Workshop& make, std::uint32_t floor, std::uint32_t back, std::uint32_t side) {
  make->add_shape(quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}, true), floor);
  make->add_shape(quad({-2, 0, -2}, {4, 0, 0}, {0, 3, 0}, true, 0.1), back);
  make->add_shape(quad({-2, 0, 2}, {0, 0, -4}, {0, 3, 0}), side);
  make->add_shape(quad({2, 0, -2}, {0, 0, 4}, {0, 3, 0}), side);
}

Scene room() {
  Workshop make;
  const auto plain = make.one_sided(Diffuse{gray(0.7)});
  const auto floor = make.one_sided(Phong{textured(8, 0.1, 0.5), textured(4, 0.1, 0.4), 12});
  const auto back = make.one_sided(Diffuse{textured(8, 0.2, 0.8)});
  add_walls(make, floor, back, plain);
  make->add_shape(quad({-2, 3, -2}, {4, 0, 0}, {0, 0, 4}), plain);
  // A screen whose two sides differ, hung so that both are seen and lit.
  const auto screen = make.two_sided(Diffuse{gray(0.6)}, RoughConductor{ggx(0.3)});
  make->add_shape(quad({-1.2, 0.6, 0.8}, {0.8, 0, -0.5}, {0, 0.9, 0}), screen);
  const auto back_screen = make.two_sided(Diffuse{gray(0.5)}, RoughConductor{beckmann(0.25)});
  make->add_shape(quad({0.6, 1.4, 0.4}, {0.9, 0, 0.5}, {0, -0.9, 0}, false, 0.15), back_screen);

  RoughConductor gold{beckmann(0.3, 0.1), kGoldEta, kGoldK, gray(1.0)};
  make->add_shape(sphere_at({-0.7, 0.6, -0.7}, 0.6), make.one_sided(gold));
  RoughConductor etched{ggx(0.12, 0.35), kGoldEta, kGoldK, textured(8, 0.4, 1.0)};
  make->add_shape(round_mesh({0.8, 0.6, -0.9}, 0.6, 8), make.one_sided(etched));
  const auto turned = make.one_sided(RoughConductor{{Distribution::Phong, 0.1, 0.3}});
  make->add_shape(Disk{{-0.2, 0.02, 1.0}, {0.5, 0, 0}, {0, 0.1, -0.5}}, turned);

  const auto black = make.one_sided(Diffuse{gray(0.0)});
  make->add_shape(quad({-0.5, 2.98, -0.5}, {1, 0, 0}, {0, 0, 1}, true), black,
                  textured(8, 2.0, 8.0));
  make->add_shape(Disk{{-1.98, 1.8, 0.3}, {0, 0.35, 0}, {0, 0, 0.4}}, black, textured(6, 3.0, 7.0));
  make->add_shape(sphere_at({1.4, 2.0, -1.2}, 0.3), plain, textured(8, 3.0, 6.0));
  make->add_shape(round_mesh({-1.3, 1.9, -1.3}, 0.35, 4), plain, Rgbd{3, 4, 5});
  make->set_camera(look_at({0, 1.4, 3.4}, {0, 1.1, 0}, 0.55));
  return make->build();
}

Scene glass() {
  Workshop make;
  const auto plain = make.one_sided(Diffuse{gray(0.7)});
  add_walls(make, plain, make.one_sided(RoughConductor{beckmann(0.3)}), plain);
  const Texture tint = textured(8, 0.6, 1.0);
  make->add_shape(sphere_at({-1.0, 0.55, 0.9}, 0.5),
                  make.one_sided(Dielectric{kGlass, tint, tint}));
  const auto frosted =
      make.one_sided(RoughDielectric{beckmann(0.25, 0.1), kGlass, tint, gray(1.0)});
  make->add_shape(round_mesh({0.0, 0.6, 1.0}, 0.5, 8), frosted);
  const auto etched = make.one_sided(RoughDielectric{ggx(0.15), kGlass, gray(1.0), tint});
  make->add_shape(sphere_at({1.0, 0.55, 0.9}, 0.5), etched);
  const auto mirror = make.one_sided(Conductor{kGoldEta, kGoldK, tint});
  make->add_shape(round_mesh({-0.6, 1.7, 0.2}, 0.5, 8), mirror);
  make->add_shape(Disk{{0.9, 1.6, -0.4}, {0.6, 0, 0.1}, {0, 0.6, 0}},
                  make.one_sided(Conductor{kGoldEta, kGoldK, gray(1.0)}));
  const auto pane = make.one_sided(RoughDielectric{ggx(0.3), kGlass, gray(1.0), gray(1.0)});
  make->add_shape(quad({-0.5, 0.1, 1.9}, {1.0, 0, 0.1}, {0, 1.1, 0}, false, 0.1), pane);

  const auto black = make.one_sided(Diffuse{gray(0.0)});
  make->add_emitter(PointEmitter{{1.5, 2.6, 1.2}, {6, 6, 5}});
  make->add_shape(quad({-1.2, 2.9, -0.4}, {1.6, 0, 0}, {0, 0, 1.6}), black, Rgbd{4, 4, 4});
  make->add_shape(sphere_at({1.5, 1.0, 1.4}, 0.25), black, Rgbd{8, 7, 6});
  make->add_shape(round_mesh({-1.5, 1.2, 0.0}, 0.35, 4, false), black, Rgbd{6, 7, 8});
  make->set_camera(look_at({0, 1.4, 3.6}, {0, 1.0, 0}, 0.5));
  return make->build();
}

/// Glossy things on a floor, and a window before the camera.
void add_yard(Workshop& make, const Bsdf& window) {
  const Texture tint = textured(8, 0.5, 1.0);
  make->add_shape(quad({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}, true),
                  make.one_sided(Phong{textured(8, 0.1, 0.5), gray(0.4), 40}));
  make->add_shape(quad({-3, 0, -3}, {0, 0, 6}, {0, 2, 0}), make.one_sided(Diffuse{gray(0.6)}));
  make->add_shape(sphere_at({-0.9, 0.5, 0}, 0.5),
                  make.one_sided(RoughConductor{ggx(0.1), kGoldEta, kGoldK, tint}));
  make->add_shape(round_mesh({0.3, 0.5, -0.5}, 0.5, 8),
                  make.one_sided(RoughConductor{beckmann(0.1), kGoldEta, kGoldK, gray(1.0)}));
  make->add_shape(sphere_at({1.2, 0.5, 0.2}, 0.5), make.one_sided(Diffuse{textured(8, 0.2, 0.8)}));
  make->add_shape(round_mesh({0.2, 0.35, 0.8}, 0.3, 6),
                  make.one_sided(RoughDielectric{beckmann(0.2), kGlass, gray(1.0), tint}));
  make->add_shape(sphere_at({-0.4, 0.3, 1.0}, 0.25),
                  make.one_sided(Dielectric{kGlass, gray(1.0), gray(1.0)}));
  make->add_shape(quad({-0.9, 0.1, 1.9}, {0.9, 0, 0}, {0, 1.2, 0}), make.one_sided(window));
  make->set_camera(look_at({0, 1.2, 3.2}, {0, 0.5, 0}, 0.6));
}

Scene sun() {
  Workshop make;
  add_yard(make, Dielectric{1.2, gray(1.0), gray(1.0)});
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(0.7, Vec3d::UnitY()) * Eigen::AngleAxisd(0.4, Vec3d::UnitX()))
          .toRotationMatrix();
  make->set_environment(EnvironmentMap(sun_bitmap(32, 16, 300.0F), turn, 0.8));
  make->add_emitter(PointEmitter{{1.0, 2.0, 1.5}, {2, 2, 2}});
  return make->build();
}

Scene overcast() {
  Workshop make;
  add_yard(make, RoughDielectric{beckmann(0.1), 1.3, gray(1.0), gray(1.0)});
  make->set_environment(ConstantEnvironment{{0.8, 0.9, 1.0}});
  return make->build();
}

std::shared_ptr<const BsdfBox> boxed(Bsdf bsdf) {
  return std::make_shared<const BsdfBox>(BsdfBox{std::move(bsdf)});
}

Scene stage() {
  Workshop make;
  const auto plain = make.one_sided(Diffuse{gray(0.7)});
  add_walls(make, make.one_sided(Phong{textured(8, 0.2, 0.6), gray(0.3), 15}),
            make.one_sided(Diffuse{textured(8, 0.3, 0.8)}), plain);
  make->add_shape(sphere_at({-0.8, 0.5, 0.2}, 0.5),
                  make.one_sided(RoughConductor{ggx(0.25), kGoldEta, kGoldK, gray(1.0)}));
  make->add_shape(round_mesh({0.5, 0.5, 0.3}, 0.5, 8), plain);
  make->add_shape(sphere_at({1.2, 0.35, 0.9}, 0.35),
                  make.one_sided(RoughDielectric{beckmann(0.25), kGlass, gray(1.0), gray(1.0)}));
  make->add_shape(sphere_at({-0.2, 0.3, 1.1}, 0.3),
                  make.one_sided(Dielectric{kGlass, gray(1.0), gray(1.0)}));
  make->add_shape(quad({-1.8, 0.1, 1.0}, {0.2, 0, -0.8}, {0, 1.2, 0}),
                  make.one_sided(Conductor{kGoldEta, kGoldK, gray(1.0)}));
  make->add_emitter(SpotEmitter({0.3, 3.2, 2.0}, {-0.1, -3.0, -1.8}, {90, 80, 70}, 0.6, 0.2));
  make->add_emitter(DirectionalEmitter{Vec3d(0.5, -1.0, -0.8).normalized(), {0.8, 1.0, 1.2}});
  make->set_camera(look_at({0, 1.4, 3.6}, {0, 0.9, 0}, 0.5));
  return make->build();
}

void set_small_film(Camera& camera) {
  camera.half_height = 0.375;
  camera.film_width = 32;
  camera.film_height = 24;
}

}  // namespace

Scene coated(bool with_point) {
  Workshop make;
  const auto plain = make.one_sided(Diffuse{gray(0.7)});
  add_walls(make, make.one_sided(Plastic(kGlass, textured(8, 0.1, 0.8), textured(4, 0.4, 1), true)),
            make.one_sided(Plastic(1.3, gray(0.7), gray(1.0), false)), plain);
  make->add_shape(sphere_at({-0.9, 0.5, 0.1}, 0.5),
                  make.one_sided(RoughPlastic(beckmann(0.2), kGlass, textured(8, 0.1, 0.8),
                                              textured(4, 0.4, 1), true)));
  make->add_shape(round_mesh({0.3, 0.5, -0.2}, 0.5, 8),
                  make.one_sided(RoughPlastic(ggx(0.25), kGlass, gray(0.08), gray(1.0), false)));
  const Texture tint = textured(8, 0.5, 1.0);
  make->add_shape(quad({-1.7, 0.1, 1.0}, {1.0, 0, 0.3}, {0, 1.2, 0}, true, 0.1),
                  make.one_sided(ThinDielectric{kGlass, tint, tint}));
  make->add_shape(sphere_at({0.0, 0.3, 1.0}, 0.3),
                  make.one_sided(ThinDielectric{kGlass, gray(1.0), gray(1.0)}));
  const Texture holes = textured(8, 0.1, 0.9);
  make->add_shape(
      quad({0.4, 0.1, 0.9}, {0.8, 0, -0.2}, {0, 1.0, 0}, true),
      make.two_sided(
          Mask{holes, boxed(Diffuse{textured(8, 0.3, 0.8)})},
          Mask{holes, boxed(RoughPlastic(ggx(0.3), kGlass, gray(0.5), gray(1.0), false))}));
  make->add_shape(
      sphere_at({1.3, 0.45, 0.3}, 0.45),
      make.one_sided(Mask{textured(8, 0.2, 0.8), boxed(ThinDielectric{kGlass, gray(1.0), tint})}));
  make->add_shape(sphere_at({1.1, 1.5, -0.6}, 0.4),
                  make.two_sided(Mask{gray(0.6), boxed(Plastic(kGlass, gray(0.6), tint, false))},
                                 Mask{gray(0.6), nullptr}));
  make->add_shape(sphere_at({-0.3, 1.5, -0.8}, 0.4), make.one_sided(Mask{gray(0.0), nullptr}));
  const RoughConductor gold{beckmann(0.3, 0.12), kGoldEta, kGoldK, gray(1.0)};
  make->add_shape(sphere_at({0.9, 0.25, 1.6}, 0.25),
                  make.one_sided(Coating{kGlass, tint, {0.1, 0.2, 0.3}, boxed(gold)}));
  make->add_shape(
      sphere_at({1.4, 0.3, 1.3}, 0.3),
      make.one_sided(Coating{1.3, gray(1.0), {0, 0, 0}, boxed(Diffuse{textured(8, 0.3, 0.8)})}));
  make->add_shape(
      sphere_at({-0.75, 0.28, 1.6}, 0.28),
      make.one_sided(Coating{
          kGlass, gray(1.0), {0.2, 0.1, 0.1}, boxed(Conductor{kGoldEta, kGoldK, gray(1.0)})}));
  const auto black = make.one_sided(Diffuse{gray(0.0)});
  make->add_shape(quad({-0.9, 2.8, -0.6}, {1.8, 0, 0}, {0, 0, 1.4}), black, Rgbd{4, 4, 4});
  make->add_shape(round_mesh({-1.4, 1.9, -0.5}, 0.35, 4, false), black, Rgbd{6, 7, 8});
  if (with_point) make->add_emitter(PointEmitter{{1.3, 2.4, 1.2}, {3, 3, 2.5}});
  Camera camera = look_at({0, 1.4, 3.6}, {0, 0.9, 0}, 0.5);
  set_small_film(camera);
  make->set_camera(camera);
  return make->build();
}

Scene plan(bool with_caustics) {
  Workshop make;
  const auto plain = make.one_sided(Diffuse{gray(0.7)});
  const auto floor = make.one_sided(Phong{textured(8, 0.2, 0.6), gray(0.3), 15}, tilts());
  add_walls(make, floor, plain, plain);
  make->add_shape(sphere_at({-0.8, 0.5, 0.2}, 0.5),
                  make.one_sided(Ward{Ward::Variant::Duer, 0.2, 0.4, gray(0.2), gray(0.4)}));
  make->add_shape(
      round_mesh({0.5, 0.5, -0.3}, 0.5, 8),
      make.one_sided(Ward{Ward::Variant::Ward, 0.4, 0.15, textured(8, 0.1, 0.5), gray(0.3)},
                     bumps(-0.08)));
  const Texture weight = textured(8, 0.1, 0.9);
  make->add_shape(
      sphere_at({-1.3, 0.35, 1.1}, 0.35),
      make.one_sided(
          Blend{weight,
                boxed(Ward{Ward::Variant::Balanced, 0.15, 0.15, textured(8, 0.3, 0.6), gray(0.3)}),
                boxed(RoughConductor{ggx(0.1, 0.25), kGoldEta, kGoldK, gray(1.0)})}));
  make->add_shape(
      quad({0.9, 0.1, -1.2}, {0.9, 0, 0.4}, {0, 1.4, 0}, true, 0.1),
      make.two_sided(
          Blend{weight, boxed(Plastic(kGlass, gray(0.5), gray(1.0), false)),
                boxed(Blend{gray(0.3), boxed(Phong{gray(0.3), gray(0.4), 20}),
                            boxed(Conductor{kGoldEta, kGoldK, gray(1.0)})})},
          Blend{weight, boxed(Diffuse{gray(0.7)}), boxed(Conductor{kGoldEta, kGoldK, gray(1.0)})},
          bumps(0.04)));
  if (with_caustics) {
    make->add_shape(
        round_mesh({0.6, 0.3, 1.2}, 0.3, 6),
        make.one_sided(
            Blend{weight, boxed(RoughDielectric{ggx(0.15, 0.3), kGlass, gray(1.0), gray(1.0)}),
                  boxed(Blend{gray(0.5), boxed(Dielectric{kGlass, gray(1.0), gray(1.0)}),
                              boxed(Diffuse{gray(0.6)})})},
            tilts()));
    make->add_shape(sphere_at({-0.1, 0.3, 0.9}, 0.3),
                    make.one_sided(Dielectric{kGlass, gray(1.0), gray(1.0)}));
    make->add_shape(sphere_at({1.2, 0.4, 0.6}, 0.4),
                    make.one_sided(RoughDielectric{beckmann(0.25), kGlass, gray(1.0), gray(1.0)}));
  }
  const auto black = make.one_sided(Diffuse{gray(0.0)});
  make->add_shape(quad({-0.6, 2.9, -0.6}, {1.2, 0, 0}, {0, 0, 1.2}), black, Rgbd{4, 4, 4});
  make->add_shape(round_mesh({-1.5, 1.6, -1.0}, 0.3, 4, false), black, textured(8, 2.0, 5.0));
  if (with_caustics) {
    make->add_emitter(SpotEmitter({0.3, 3.2, 2.0}, {-0.1, -3.0, -1.8}, {40, 35, 30}, 0.6, 0.2));
    make->add_emitter(DirectionalEmitter{Vec3d(0.5, -1.0, -0.8).normalized(), {0.4, 0.5, 0.6}});
  }
  Camera camera = look_at({0.8, 2.6, 3.6}, {0, 0.7, 0}, 0.5);
  camera.projection = Camera::Projection::Orthographic;
  camera.scale = 3.6;
  set_small_film(camera);
  make->set_camera(camera);
  return make->build();
}

Scene lens(bool with_caustics) {
  Workshop make;
  const auto plain = make.one_sided(Diffuse{gray(0.7)});
  make->add_shape(quad({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}),
                  make.one_sided(Phong{textured(8, 0.2, 0.6), gray(0.3), 15}));
  make->add_shape(quad({-3, 0, -2}, {6, 0, 0}, {0, 3, 0}), plain);
  make->add_shape(sphere_at({-0.7, 0.45, 1.4}, 0.45),
                  make.one_sided(RoughConductor{ggx(0.4, 0.15), kGoldEta, kGoldK, gray(1.0)}));
  make->add_shape(round_mesh({0.5, 0.5, 0.0}, 0.5, 8),
                  make.one_sided(RoughConductor{{Distribution::Phong, 0.2, 0.5}}));
  if (with_caustics) {
    make->add_shape(sphere_at({0.3, 0.3, 2.0}, 0.3),
                    make.one_sided(Dielectric{kGlass, gray(1.0), gray(1.0)}));
    make->add_shape(sphere_at({1.3, 0.4, 0.8}, 0.4),
                    make.one_sided(RoughDielectric{beckmann(0.25), kGlass, gray(1.0), gray(1.0)}));
    make->add_shape(quad({-1.8, 0.1, 0.6}, {0.3, 0, -0.8}, {0, 1.2, 0}),
                    make.one_sided(Conductor{kGoldEta, kGoldK, gray(1.0)}));
    make->add_emitter(SpotEmitter({0.3, 3.2, 2.0}, {-0.1, -3.0, -1.8}, {30, 25, 20}, 0.6, 0.2));
    make->add_emitter(DirectionalEmitter{Vec3d(0.5, -1.0, -0.8).normalized(), {0.3, 0.4, 0.5}});
  }
  const auto black = make.one_sided(Diffuse{gray(0.0)});
  make->add_shape(quad({-0.6, 2.7, 0.0}, {1.2, 0, 0}, {0, 0, 1.2}), black, Rgbd{4, 4, 4});
  make->add_shape(round_mesh({-1.3, 1.5, -0.8}, 0.3, 4, false), black, Rgbd{4, 5, 6});
  make->set_environment(ConstantEnvironment{{0.2, 0.25, 0.3}});
  Camera camera = look_at({0, 1.4, 3.8}, {0, 0.7, 0}, 0.5);
  camera.lens_radius = 0.2;
  camera.focus_depth = 2.6;
  set_small_film(camera);
  make->set_camera(camera);
  return make->build();
}

const std::vector<TestScene>& test_scenes() {
  static const std::vector<TestScene> scenes = [] {
    std::vector<TestScene> result;
    result.push_back({"room", room(), 6});
    result.push_back({"glass", glass(), 8});
    result.push_back({"sun", sun(), 6});
    result.push_back({"overcast", overcast(), 6});
    result.push_back({"stage", stage(), 6});
    result.push_back({"coated", coated(true), 6});
    result.push_back({"plan", plan(true), 6});
    result.push_back({"lens", lens(true), 6});
    return result;
  }();
  return scenes;
}

std::vector<PathSampler::Sample> light_paths(const TestScene& scene, int count,
                                             std::uint64_t seed) {
  const PathSampler sampler(scene.scene, scene.max_depth);
  std::vector<PathSampler::Sample> result;
  for (std::uint64_t i = 0; static_cast<int>(result.size()) < count; ++i) {
    Rng rng(seed, Stream::Test, i);
    const auto sample = sampler.sample(rng);
    if (!sample) continue;
    if (std::isfinite(contribution(scene.scene, sample->topology, sample->coordinates).log_target))
      result.push_back(*sample);
  }
  return result;
}

}  // namespace driftlight::test
