// SPDX-License-Identifier: Apache-2.0
/// Laws of spots and of parallel light: falloff, sampling, power and irradiance in closed form.
#include "driftlight/emitter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "driftlight/contribution.h"
#include "driftlight/random.h"
#include "driftlight/render.h"
#include "support/chi_square.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

struct Cone {
  double cutoff, beam;  ///< radians
};
const std::vector<Cone> kCones{{0.35, 0.26}, {0.9, 0.0},   {1.2, 1.2}, {2.5, 0.7},
                               {kPi, 0.4},   {0.02, 0.01}, {kPi, kPi}};

const Vec3d kAxis = Vec3d(0.4, -0.7, 0.3).normalized();

SpotEmitter spot_of(const Cone& cone) {
  return {{1, 2, 3}, 3.0 * kAxis, {4, 5, 6}, cone.cutoff, cone.beam};
}

/// The unit direction at this angle to the axis.
Vec3d at_angle(double theta, double phi) {
  return to_world(
      {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)}, kAxis);
}

// Law: the falloff is 1 up to the beam width, linear in the angle to 0 at the cutoff, and even
// about the axis.
TEST(SpotEmitter, FalloffIsLinearInTheAngle) {
  for (const Cone& cone : kCones) {
    const SpotEmitter spot = spot_of(cone);
    for (int i = 1; i < 400; ++i) {
      const double theta = kPi * i / 400.0;
      const double expected = theta <= cone.beam ? 1.0
                              : theta >= cone.cutoff
                                  ? 0.0
                                  : (cone.cutoff - theta) / (cone.cutoff - cone.beam);
      EXPECT_NEAR(spot.falloff(at_angle(theta, 0.1 * i)), expected, 1e-12 / cone.cutoff) << theta;
    }
  }
}

// Law: the falloff's gradient is its derivative, and has no part along the direction.
TEST(SpotEmitter, GradientOfTheFalloff) {
  using Jet = ceres::Jet<double, 3>;
  for (const Cone& cone : kCones) {
    const SpotEmitter spot = spot_of(cone);
    for (int i = 1; i < 200; ++i) {
      const double theta = 1.1 * std::min(cone.cutoff, 2.8) * i / 200.0;
      const Vec3d v = at_angle(theta, 0.7 * i);
      Vec3<Jet> seeded;
      for (int k = 0; k < 3; ++k) seeded[k] = Jet(v[k], k);
      const Vec3d gradient = spot.falloff_gradient(v);
      EXPECT_LT((gradient - spot.falloff(seeded).v).norm(), 1e-9 * (1.0 + gradient.norm()));
      EXPECT_NEAR(gradient.dot(v), 0.0, 1e-9 * (1.0 + gradient.norm()));
    }
  }
}

// Law: solid_angle is the integral of the falloff over the sphere.
TEST(SpotEmitter, SolidAngleIsTheIntegralOfTheFalloff) {
  for (const Cone& cone : kCones) {
    const SpotEmitter spot = spot_of(cone);
    const int count = 200000;
    double sum = 0;
    for (int i = 0; i < count; ++i) {
      const double theta = cone.cutoff * (i + 0.5) / count;
      sum += spot.falloff(at_angle(theta, 0.3)) * std::sin(theta);
    }
    const double expected = sum * 2.0 * kPi * cone.cutoff / count;
    EXPECT_NEAR(spot.solid_angle(), expected, 1e-6 * expected) << cone.cutoff;
  }
  EXPECT_NEAR(spot_of({kPi, kPi}).solid_angle(), PointEmitter{}.solid_angle(), 1e-12);
}

// Law: directions are drawn with the density falloff / solid_angle, never where it is 0.
TEST(SpotEmitter, SampleFollowsTheFalloff) {
  Rng rng(151, Stream::Test, 0);
  std::vector<double> p_values;
  for (const Cone& cone : kCones) {
    const SpotEmitter spot = spot_of(cone);
    const auto draw = [&] {
      const Vec3d v = spot.sample(rng.uniform(), rng.uniform());
      EXPECT_NEAR(v.norm(), 1.0, 1e-12);
      EXPECT_GT(spot.falloff(v), 0.0);
      return v;
    };
    // In angle, which resolves narrow cones too: the CDF of theta at the draws is uniform.
    const auto cdf = [&](double theta) {
      const double transition = cone.cutoff - cone.beam;
      double f = 1.0 - std::cos(std::min(theta, cone.beam));
      if (theta > cone.beam)
        f += std::cos(cone.beam) +
             (std::sin(cone.beam) - std::sin(theta) - (cone.cutoff - theta) * std::cos(theta)) /
                 transition;
      return 2.0 * kPi * f / spot.solid_angle();
    };
    std::vector<double> thetas, phis;
    const TangentBasis basis = tangent_basis(kAxis);
    for (int i = 0; i < 20000; ++i) {
      const Vec3d v = draw();
      const double c = kAxis.dot(v);
      thetas.push_back(cdf(std::atan2((v - c * kAxis).norm(), c)));
      phis.push_back(std::atan2(basis.b.dot(v), basis.t.dot(v)) / (2.0 * kPi) + 0.5);
    }
    p_values.push_back(chi_square_uniform(thetas).p_value);
    p_values.push_back(chi_square_uniform(phis).p_value);
    if (cone.cutoff < 0.1) continue;
    const SphereGrid grid(kAxis, 24, 12, 1.0);
    const auto density = [&](const Vec3d& v) { return spot.falloff(v) / spot.solid_angle(); };
    p_values.push_back(chi_square_directions(grid, 20000, draw, density).p_value);
  }
  const double significance = sidak(0.01, static_cast<int>(p_values.size()));
  for (const double p : p_values) EXPECT_GT(p, significance);
  // The ends of the unit square.
  for (const Cone& cone : kCones)
    for (const double u : {0.0, 1.0 - 0x1p-53})
      EXPECT_GT(spot_of(cone).falloff(spot_of(cone).sample(u, u)), 0.0) << cone.cutoff;
}

const Rgbd kAlbedo{0.2, 0.5, 0.8};

/// A diffuse floor, y = 0, seen from `eye` through a pixel at the point x; lit as `light` says.
Scene lit_floor(const Vec3d& x, const std::function<void(SceneBuilder&)>& light) {
  SceneBuilder builder;
  const auto floor =
      builder.add_material({builder.add_bsdf(Diffuse{Texture(kAlbedo)}), std::nullopt});
  builder.add_shape(quad({-9, 0, 9}, {18, 0, 0}, {0, 0, -18}), floor);
  light(builder);
  Camera camera = look_at({0.3, 4.0, 5.0}, x, 1e-7);
  camera.film_width = camera.film_height = 1;
  builder.set_camera(camera);
  return builder.build();
}

/// The colour of its only pixel, by each of the Monte Carlo integrators that have no noise here.
void expect_pixel(const Scene& scene, const Rgbd& expected) {
  const auto compare = [&](const Image& image, double tolerance) {
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(static_cast<double>(image.pixel(0, 0)[c]), expected[c],
                  tolerance * expected[c] + 1e-12);
  };
  compare(render_path(scene, {2}, RenderOptions{}, 4).image, 1e-4);
  compare(render_bdpt(scene, {.max_depth = 2}, RenderOptions{}, 4).image, 1e-4);
}

// Law: parallel light of irradiance E on a diffuse floor shows rho / pi E cos; from below, nothing.
TEST(DirectionalEmitter, IrradianceOfAFloor) {
  const Rgbd irradiance{3, 2, 1};
  for (const double angle : {0.0, 0.4, 1.3, 2.0}) {
    const Vec3d direction(std::sin(angle), -std::cos(angle), 0.0);
    const Scene scene = lit_floor({1, 0, -1}, [&](SceneBuilder& builder) {
      builder.add_emitter(DirectionalEmitter{direction, irradiance});
    });
    expect_pixel(scene, kAlbedo / kPi * irradiance * std::max(0.0, std::cos(angle)));
  }
}

// Law: a spot at height h over a diffuse floor shows rho / pi I falloff cos^3 / h^2, and nothing
// beyond its cutoff.
TEST(SpotEmitter, IrradianceOfAFloor) {
  const Rgbd intensity{3, 2, 1};
  const double height = 2.5;
  const double cutoff = 0.6;
  const double beam = 0.2;
  for (const double angle : {0.0, 0.15, 0.3, 0.5, 0.59, 0.61}) {
    const double falloff = std::clamp((cutoff - angle) / (cutoff - beam), 0.0, 1.0);
    const Vec3d x(height * std::tan(angle), 0, 0);
    const Scene scene = lit_floor(x, [&](SceneBuilder& builder) {
      builder.add_emitter(SpotEmitter({0, height, 0}, {0, -1, 0}, intensity, cutoff, beam));
    });
    const double cosine = std::cos(angle);
    expect_pixel(scene,
                 kAlbedo / kPi * intensity * falloff * std::pow(cosine, 3) / (height * height));
  }
}

// Law: in a closed diffuse sphere every bounce lights all of it alike, by rho Phi / (4 pi R^2): the
// light of paths of 3 edges, where no light comes directly, tells the power Phi = I solid_angle.
TEST(SpotEmitter, PowerInAClosedSphere) {
  const double albedo = 0.7;
  const double radius = 1.5;
  const double cutoff = 0.7;
  const double beam = 0.3;
  SceneBuilder builder;
  const auto white = builder.add_bsdf(Diffuse{Texture(Rgbd::Constant(albedo))});
  const auto material = builder.add_material({white, std::nullopt});
  Sphere sphere;
  sphere.radius = radius;
  sphere.flip_normals = true;
  builder.add_shape(sphere, material);
  builder.add_emitter(SpotEmitter({0, 0, 0.2}, {0, 0, 1}, {5, 5, 5}, cutoff, beam));
  builder.set_camera(look_at({0.1, 0.2, 0.5}, {0, 0, -1}, 0.6));
  const Scene scene = builder.build();
  const double transition = (std::sin(cutoff) - std::sin(beam)) / (cutoff - beam);
  const double power = 5.0 * 2.0 * kPi * (1.0 - transition);
  const double expected = albedo / kPi * albedo * power / (4.0 * kPi * radius * radius);
  const auto test = [&](const char* name, const auto& render_with) {
    Moments means;
    for (std::uint64_t run = 0; run < 16; ++run) {
      RenderOptions render;
      render.seed = run;
      const Image image = render_with(render).image;
      double sum = 0;
      for (const float value : image.rgb) sum += static_cast<double>(value);
      means.add(sum / static_cast<double>(image.rgb.size()));
    }
    EXPECT_GT(student_p_value(means, expected), 0.0033)
        << name << " " << means.mean() << " +- " << means.error() << " " << expected;
    EXPECT_LT(means.error(), 0.01 * expected) << name;
  };
  test("path", [&](const RenderOptions& render) { return render_path(scene, {3}, render, 200); });
  test("bdpt", [&](const RenderOptions& render) {
    return render_bdpt(scene, {.max_depth = 3}, render, 20);
  });
  test("light", [&](const RenderOptions& render) { return render_light(scene, {3}, render, 100); });
}

// Law: the luminance of a one-bounce path is W rho / pi cos I falloff / r^2 under a spot, and
// W rho / pi cos E under parallel light; -infinity outside of the cone.
TEST(Contribution, DeltaEmitters) {
  const Rgbd intensity{3, 2, 1};
  const SpotEmitter spot({0, 2.5, 0}, {0, -1, 0}, intensity, 0.6, 0.2);
  for (const double angle : {0.1, 0.4, 0.7}) {
    const Vec3d x(2.5 * std::tan(angle), 0, 0);
    const Scene scene = lit_floor(x, [&](SceneBuilder& builder) {
      builder.add_emitter(spot);
      builder.add_emitter(DirectionalEmitter{{0, -1, 0}, intensity});
    });
    PathTopology pattern;
    pattern.scatter_count = 1;
    pattern.block_count = 1;
    PathCoordinates coordinates;
    coordinates(0) = scene.camera().forward;
    const double base = std::log(luminance(Rgbd(kAlbedo * intensity)) / kPi) +
                        scene.camera().log_importance(coordinates(0));
    PathTopology topology;
    pattern.end = PathEnd::DirectionalConnection;
    pattern.emitter = 1;
    ASSERT_EQ(trace(scene, pattern, coordinates, topology), TraceStatus::Ok);
    EXPECT_NEAR(contribution(scene, topology, coordinates).log_target, base, 1e-9);
    pattern.end = topology.end = PathEnd::PointConnection;
    pattern.emitter = topology.emitter = 0;
    const bool lit = angle < 0.6;
    EXPECT_EQ(trace(scene, pattern, coordinates, pattern),
              lit ? TraceStatus::Ok : TraceStatus::Missed);
    const double factor =
        std::min(1.0, (0.6 - angle) / 0.4) * std::pow(std::cos(angle), 3) / (2.5 * 2.5);
    const double log_target = contribution(scene, topology, coordinates).log_target;
    if (lit)
      EXPECT_NEAR(log_target, base + std::log(factor), 1e-9);
    else
      EXPECT_EQ(log_target, -std::numeric_limits<double>::infinity());
  }
}

}  // namespace
}  // namespace driftlight::test
