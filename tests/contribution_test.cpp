// SPDX-License-Identifier: Apache-2.0
/// Laws of the contribution: f of single bounces in closed form, worked out here from the textbook
/// formulas and plain products.
#include "driftlight/contribution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "driftlight/phase_space.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

const Vec3d kPoint{0.5, 0.3, -4.0};      // on the surface, seen from the origin
const Vec3d kLightPoint{0.4, 0.2, 3.0};  // on the lamp behind the camera
const Vec3d kNormal{0, 0, 1};
const Vec3d kBulb{-1.0, 1.5, -1.0};
const Rgbd kLampRadiance{3, 2, 1};
const Rgbd kBulbIntensity{5, 6, 7};
const Rgbd kBackRadiance{1, 4, 2};
const Rgbd kSky{0.5, 0.7, 0.9};

/// A plane z = -4 that faces the camera at the origin, a lamp at z = 3 and a bulb before it,
/// another lamp at z = -8 behind it, and a constant sky around.
class OneBounce {
 public:
  static constexpr std::uint32_t kLamp = 0;
  static constexpr std::uint32_t kBackLamp = 1;
  static constexpr std::uint32_t kBulbEmitter = 2;
  static constexpr std::uint32_t kSkyEmitter = 3;

  explicit OneBounce(const Bsdf& bsdf) : scene_(build(bsdf)) {
    pattern_.scatter_count = 1;
    pattern_.block_count = 1;
    pattern_.vertices[0].delta = is_delta(bsdf);
  }

  /// f of the path origin - kPoint - end as traced; `block` is the free direction or emitter point.
  Rgbd f(PathEnd end, std::uint32_t emitter, const Vec3d* block,
         Scattering scattering = Scattering::Reflection) const {
    PathTopology pattern = pattern_;
    pattern.end = end;
    pattern.emitter = emitter;
    pattern.vertices[0].scattering = scattering;
    PathCoordinates coordinates;
    coordinates(0) = kPoint.normalized();
    if (block != nullptr) coordinates(pattern.block_count++) = *block;
    PathTopology topology;
    const TraceStatus status = trace(scene_, pattern, coordinates, topology);
    EXPECT_EQ(status, TraceStatus::Ok);
    if (status != TraceStatus::Ok) return Rgbd::Constant(-1.0);
    EXPECT_EQ(topology.emitter, emitter);
    const Contribution c = contribution(scene_, topology, coordinates);
    EXPECT_NEAR(luminance(c.color), 1.0, 1e-12);
    return std::exp(c.log_target) * c.color;
  }

 private:
  static Scene build(const Bsdf& bsdf) {
    SceneBuilder builder;
    const auto material = builder.add_material({builder.add_bsdf(bsdf), std::nullopt});
    const auto black =
        builder.add_material({builder.add_bsdf(Diffuse{Texture(Rgbd::Zero())}), std::nullopt});
    builder.add_shape(quad({-4, -4, -4}, {8, 0, 0}, {0, 8, 0}), material);
    builder.add_shape(quad({-2, -2, 3}, {0, 4, 0}, {4, 0, 0}), black, kLampRadiance);
    builder.add_shape(quad({-4, -4, -8}, {8, 0, 0}, {0, 8, 0}), black, kBackRadiance);
    builder.add_emitter(PointEmitter{kBulb, kBulbIntensity});
    builder.set_environment(ConstantEnvironment{kSky});
    Camera camera = look_at({0, 0, 0}, {0, 0, -1}, 0.6);
    camera.half_height = 0.4;
    builder.set_camera(camera);
    return builder.build();
  }

  Scene scene_;
  PathTopology pattern_;
};

/// W = 1 / (A cos^3) with the film 1.2 x 0.8 at distance 1.
double importance() {
  const double cosine = 4.0 / kPoint.norm();
  return 1.0 / (1.2 * 0.8 * cosine * cosine * cosine);
}

const Vec3d kWi = -kPoint.normalized();

void expect_near(const Rgbd& actual, const Rgbd& expected) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(actual[c], expected[c], 1e-9 * expected[c]) << c;
}

// Law: point emitter over a diffuse surface, W rho / pi cos I / r^2.
TEST(Contribution, PointConnection) {
  const Rgbd rho{0.2, 0.5, 0.8};
  const OneBounce bounce(Diffuse{Texture(rho)});
  const Vec3d edge = kBulb - kPoint;
  const double cosine = edge.z() / edge.norm();
  expect_near(bounce.f(PathEnd::PointConnection, OneBounce::kBulbEmitter, nullptr),
              importance() * rho / kPi * cosine * kBulbIntensity / edge.squaredNorm());
}

// Law: connection to an area emitter, W rho / pi L cos cos_y / r^2, per area.
TEST(Contribution, AreaConnection) {
  const Rgbd rho{0.2, 0.5, 0.8};
  const OneBounce bounce(Diffuse{Texture(rho)});
  const Vec3d edge = kLightPoint - kPoint;
  const double cosine = edge.z() / edge.norm();
  expect_near(bounce.f(PathEnd::AreaConnection, OneBounce::kLamp, &kLightPoint),
              importance() * rho / kPi * kLampRadiance * cosine * cosine / edge.squaredNorm());
}

// Law: a Phong surface hits the lamp, W (rho_d / pi + rho_s (n + 2) / (2 pi) cos^n) cos L.
TEST(Contribution, PhongHit) {
  const Rgbd diffuse{0.1, 0.2, 0.3};
  const Rgbd specular{0.4, 0.3, 0.2};
  const OneBounce bounce(Phong{Texture(diffuse), Texture(specular), 7});
  const Vec3d wo = (kLightPoint - kPoint).normalized();
  const Vec3d mirror(-kWi.x(), -kWi.y(), kWi.z());
  const Rgbd brdf = diffuse / kPi + specular * 9.0 / (2.0 * kPi) * std::pow(wo.dot(mirror), 7);
  expect_near(bounce.f(PathEnd::Hit, OneBounce::kLamp, &wo),
              importance() * brdf * wo.z() * kLampRadiance);
}

/// Smith's G1 in Walter's form for GGX, with the tangent from the angle.
double ggx_g1(double cosine, double alpha) {
  const double tangent = std::tan(std::acos(cosine));
  return 2.0 / (1.0 + std::sqrt(1.0 + alpha * alpha * tangent * tangent));
}
double ggx_d(double cosine, double alpha) {
  const double tangent = std::tan(std::acos(cosine));
  return alpha * alpha /
         (kPi * std::pow(cosine, 4) * std::pow(alpha * alpha + tangent * tangent, 2));
}

// Law: rough metal under the sky, W F D G / (4 cos_i cos_o) cos_o L.
TEST(Contribution, RoughMetalUnderTheSky) {
  const double alpha = 0.35;
  const Rgbd eta{0.2, 0.4, 1.4};
  const Rgbd k{3.9, 2.4, 1.6};
  const Rgbd tint{0.9, 0.8, 0.7};
  const OneBounce bounce(RoughConductor{{Distribution::Ggx, alpha}, eta, k, Texture(tint)});
  const Vec3d wo = Vec3d(0.5, 0.4, 0.7).normalized();
  const Vec3d h = (kWi + wo).normalized();
  Rgbd fresnel;
  for (int c = 0; c < 3; ++c) fresnel[c] = fresnel_conductor(kWi.dot(h), eta[c], k[c]);
  const double g = ggx_g1(kWi.z(), alpha) * ggx_g1(wo.z(), alpha);
  const Rgbd brdf = tint * fresnel * ggx_d(h.z(), alpha) * g / (4.0 * kWi.z() * wo.z());
  expect_near(bounce.f(PathEnd::Environment, OneBounce::kSkyEmitter, &wo),
              importance() * brdf * wo.z() * kSky);
}

// Law: transmission through a rough interface (Walter et al. 2007, equation 21) with the radiance's
// factor (eta_i / eta_t)^2.
TEST(Contribution, RoughTransmission) {
  const double alpha = 0.4;
  const double eta = 1.3;
  const OneBounce bounce(RoughDielectric{
      {Distribution::Ggx, alpha}, eta, Texture(Rgbd::Ones()), Texture(Rgbd::Ones())});
  const Vec3d wo = Vec3d(-0.2, 0.1, -1.0).normalized();
  // Toward the side of the lower index.
  const Vec3d h = -(kWi + eta * wo).normalized();
  const double ih = kWi.dot(h);
  const double oh = wo.dot(h);
  const double fresnel = fresnel_dielectric(ih, eta);
  const double g = ggx_g1(kWi.z(), alpha) * ggx_g1(-wo.z(), alpha);
  const double btdf = std::abs(ih * oh / (kWi.z() * wo.z())) * eta * eta * (1.0 - fresnel) * g *
                      ggx_d(h.z(), alpha) / std::pow(ih + eta * oh, 2);
  const double f = importance() * btdf / (eta * eta) * std::abs(wo.z());
  expect_near(bounce.f(PathEnd::Hit, OneBounce::kBackLamp, &wo, Scattering::Transmission),
              f * kBackRadiance);
}

// Law: a mirror shows the lamp as W F L; smooth glass shows what is behind it as
// W (1 - R) / eta^2 L, with no free direction at all.
TEST(Contribution, DeltaBounces) {
  const Rgbd eta{0.2, 0.4, 1.4};
  const Rgbd k{3.9, 2.4, 1.6};
  // The ray by way of kPoint comes to the lamp at (1.375, 0.825, 3).
  const OneBounce metal(Conductor{eta, k, Texture(Rgbd::Ones())});
  Rgbd fresnel;
  for (int c = 0; c < 3; ++c) fresnel[c] = fresnel_conductor(kWi.z(), eta[c], k[c]);
  expect_near(metal.f(PathEnd::Hit, OneBounce::kLamp, nullptr),
              importance() * fresnel * kLampRadiance);

  const OneBounce glass(Dielectric{1.4, Texture(Rgbd::Ones()), Texture(Rgbd::Ones())});
  const double r = fresnel_dielectric(kWi.z(), 1.4);
  expect_near(glass.f(PathEnd::Hit, OneBounce::kBackLamp, nullptr, Scattering::Transmission),
              importance() * (1.0 - r) / (1.4 * 1.4) * kBackRadiance);
  expect_near(glass.f(PathEnd::Hit, OneBounce::kLamp, nullptr), importance() * r * kLampRadiance);
}

// Law: log_target is the log of the luminance of f for paths of every class, and the visitor's sum
// of logarithms equals a plain product of its factors.
TEST(Contribution, SumOfLogarithmsEqualsTheProduct) {
  struct Product : WalkVisitor<double> {
    Rgbd f = Rgbd::Ones();
    void multiply(const ScaledColor<double>& factor) {
      f *= std::exp(factor.log_scale) * factor.color;
    }
    void lens(const Camera& camera, const Vec3d&) {
      f /= kPi * camera.lens_radius * camera.lens_radius;
    }
    void sensor(const Camera& camera, const Vec3d& v, const Vec3d&) {
      f *= 1.0 / (camera.area() * std::pow(camera.forward.dot(v), 3));
    }
    void scatter(const ScatterEvent<double>& e) { multiply(eval(e.bsdf, e.surface(), e.wi, e.wo)); }
    void connect(const ScatterEvent<double>& e) { scatter(e); }
    void delta(const ScatterEvent<double>& e) {
      multiply(eval_delta(e.bsdf, e.surface(), e.wi, e.scattering));
    }
    void hit(const AreaEmitter& emitter, const double&, const double&) { f *= emitter.radiance; }
    void emission_texture(const Texture& texture, const Vec2d& uv) { f *= texture.eval(uv); }
    void environment(const Emitter& emitter, const Vec3d& v) {
      const auto* map = std::get_if<EnvironmentMap>(&emitter);
      f *= map != nullptr ? map->eval(v) : std::get<ConstantEnvironment>(emitter).radiance;
    }
    void area_connection(const AreaEmitter& emitter, const double& cosine, const double& r2) {
      f *= emitter.radiance * (cosine / r2);
    }
    void point_connection(const Emitter& emitter, const Vec3d& wo, const double& r2) {
      const auto* spot = std::get_if<SpotEmitter>(&emitter);
      f *= spot != nullptr ? Rgbd(spot->intensity() * spot->falloff(Vec3d(-wo)) / r2)
                           : Rgbd(std::get<PointEmitter>(emitter).intensity / r2);
    }
    void directional_connection(const DirectionalEmitter& emitter) { f *= emitter.irradiance; }
  };
  for (const TestScene& test : test_scenes()) {
    for (const PathSampler::Sample& path : light_paths(test, 500, 91)) {
      Product product;
      walk<double>(test.scene, path.topology, path.coordinates, product);
      const Contribution c = contribution(test.scene, path.topology, path.coordinates);
      if (c.log_target < -600.0) continue;  // the product underflows, which is the point of the sum
      EXPECT_NEAR(c.log_target, std::log(luminance(product.f)), 1e-10);
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(c.color[i], product.f[i] / luminance(product.f), 1e-10);
    }
  }
}

// Law: the back of a one-sided lamp is black: log_target = -infinity, not NaN.
TEST(Contribution, BackOfALampIsBlack) {
  SceneBuilder builder;
  const auto material = builder.add_material({builder.add_bsdf(Diffuse{}), std::nullopt});
  builder.add_shape(quad({-1, -1, -2}, {0, 2, 0}, {2, 0, 0}), material, Rgbd::Ones());
  builder.set_camera(look_at({0, 0, 0}, {0, 0, -1}, 0.3));
  const Scene scene = builder.build();
  PathTopology topology;
  topology.block_count = 1;
  topology.vertices[0].hit = {0, 0};
  PathCoordinates coordinates;
  coordinates(0) = {0, 0, -1};
  EXPECT_EQ(contribution(scene, topology, coordinates).log_target,
            -std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace driftlight::test
