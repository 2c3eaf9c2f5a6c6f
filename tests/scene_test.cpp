// SPDX-License-Identifier: Apache-2.0
/// Laws of the scene: rays find what they should and never their own surface, and emitters are
/// sampled with the density they say.
#include "driftlight/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "driftlight/error.h"
#include "driftlight/random.h"
#include "support/chi_square.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

Vec3d random_direction(Rng& rng) { return square_to_sphere(rng.uniform(), rng.uniform()); }

/// A scene of one shape that emits.
Scene scene_of(Geometry geometry) {
  SceneBuilder builder;
  const auto material = builder.add_material({builder.add_bsdf(Diffuse{}), std::nullopt});
  builder.add_shape(std::move(geometry), material, Rgbd::Ones());
  return builder.build();
}

// Law: a hit's interaction lies on the ray, in front of it, on the primitive.
TEST(Scene, HitsLieOnTheRay) {
  Rng rng(131, Stream::Test, 0);
  for (const TestScene& test : test_scenes()) {
    int hits = 0;
    for (int i = 0; i < 3000; ++i) {
      const Ray<double> ray{test.scene.camera().origin, random_direction(rng)};
      const Hit hit = test.scene.intersect(ray.origin, ray.direction);
      if (!hit.valid()) continue;
      ++hits;
      const Interaction<double> at = test.scene.interact(hit, ray);
      const Vec3d edge = at.p - ray.origin;
      EXPECT_GT(edge.dot(ray.direction), 0.0);
      EXPECT_LT(edge.cross(ray.direction).norm(), 1e-6 * edge.norm());
      EXPECT_NEAR(at.n_g.norm(), 1.0, 1e-12);
      EXPECT_NEAR(at.n_s.norm(), 1.0, 1e-12);
      EXPECT_FALSE(test.scene.occluded(ray.origin, ray.origin + 0.999 * edge));
      EXPECT_TRUE(test.scene.occluded(ray.origin, ray.origin + 1.001 * edge));
      EXPECT_TRUE(test.scene.occluded_to_infinity(ray.origin, ray.direction));
    }
    EXPECT_GT(hits, 300) << test.name;
  }
}

// Law: no ray from inside a closed mesh gets out, least of all through shared edges and corners.
TEST(Scene, ClosedMeshesAreWatertight) {
  Rng rng(132, Stream::Test, 0);
  const std::vector<TriangleMesh> meshes{box({-1, -0.7, -0.4}, {1.1, 0.8, 0.9}),
                                         round_mesh({0.2, 0.1, 0.0}, 1.0, 12)};
  for (const TriangleMesh& mesh : meshes) {
    const Scene scene = scene_of(mesh);
    for (int i = 0; i < 20000; ++i) {
      const auto& triangle = mesh.triangles[static_cast<std::size_t>(
          rng.uniform() * static_cast<double>(mesh.triangles.size()))];
      const Vec3d a = mesh.positions[triangle[0]].cast<double>();
      const Vec3d b = mesh.positions[triangle[1]].cast<double>();
      const double s = i % 3 == 0 ? 0.0 : rng.uniform();
      const Vec3d origin = 0.3 * random_direction(rng);
      const Vec3d target =
          i % 3 == 2 ? Vec3d(origin + random_direction(rng)) : Vec3d(a + s * (b - a));
      EXPECT_TRUE(scene.intersect(origin, (target - origin).normalized()).valid());
    }
  }
}

/// Shapes of size `magnitude` about a point as far from the origin.
std::vector<Geometry> shapes_at(double magnitude, Rng& rng) {
  const Vec3d center = 3.0 * magnitude * random_direction(rng);
  Sphere sphere;
  sphere.center = center;
  sphere.radius = magnitude;
  const Vec3d u = magnitude * random_direction(rng);
  const Vec3d v = magnitude * u.cross(random_direction(rng)).normalized();
  Cylinder cylinder;
  cylinder.base = center;
  cylinder.length = 1.5 * magnitude;
  cylinder.radius = 0.7 * magnitude;
  return {sphere, Disk{center, u, v}, quad(center, u, v), round_mesh(center, magnitude, 16, false),
          cylinder};
}

// Law: a ray that starts at leave() does not find the surface that it leaves: not at all on the
// outer side of convex shapes, whatever the angle, at magnitudes from 1e-2 to 1e3.
TEST(Scene, LeaveKeepsRaysOffTheirOwnSurface) {
  Rng rng(133, Stream::Test, 0);
  int left = 0;
  for (const double magnitude : {1e-2, 0.1, 1.0, 30.0, 1e3}) {
    for (Geometry& shape : shapes_at(magnitude, rng)) {
      const auto* mesh = std::get_if<TriangleMesh>(&shape);
      const bool flat =
          std::holds_alternative<Disk>(shape) || (mesh != nullptr && mesh->triangles.size() == 2);
      const Scene scene = scene_of(std::move(shape));
      for (int i = 0; i < 1500; ++i) {
        const Vec3d from = scene.center() + 5.0 * magnitude * random_direction(rng);
        const Vec3d toward = scene.center() + 0.7 * magnitude * random_direction(rng);
        const Ray<double> ray{from, (toward - from).normalized()};
        const Hit hit = scene.intersect(ray.origin, ray.direction);
        if (!hit.valid()) continue;
        ++left;
        const Interaction<double> at = scene.interact(hit, ray);
        const double side = flat && i % 2 == 0 ? -1.0 : 1.0;
        // Grazing: cosines down to 1e-7.
        const double cosine = side * std::pow(10.0, -7.0 * rng.uniform());
        const double phi = 2.0 * kPi * rng.uniform();
        const double sine = std::sqrt(1.0 - cosine * cosine);
        const Vec3d wo = to_world({sine * std::cos(phi), sine * std::sin(phi), cosine}, at.n_g);
        const Vec3d start = scene.leave(at.p, at.n_g, wo);
        EXPECT_FALSE(scene.intersect(start, wo).valid())
            << "magnitude " << magnitude << " cosine " << cosine;
        EXPECT_LT((start - at.p).norm(), 1e-4 * magnitude);
      }
    }
  }
  EXPECT_GT(left, 10000);
}

// Law: a ray that leaves into a sphere finds its far side, at the distance 2 r cos.
TEST(Scene, LeaveIntoASphereFindsTheFarSide) {
  Rng rng(134, Stream::Test, 0);
  for (const double magnitude : {1e-2, 1.0, 1e3}) {
    Sphere sphere;
    sphere.center = 2.0 * magnitude * random_direction(rng);
    sphere.radius = magnitude;
    const Scene scene = scene_of(sphere);
    for (int i = 0; i < 1500; ++i) {
      const Vec3d n = random_direction(rng);
      const Vec3d p = sphere.center + magnitude * n;
      const double cosine = -std::pow(10.0, -1.5 * rng.uniform());
      const double sine = std::sqrt(1.0 - cosine * cosine);
      const Vec3d wo = to_world({sine, 0.0, cosine}, n);
      const Hit hit = scene.intersect(scene.leave(p, n, wo), wo);
      ASSERT_TRUE(hit.valid());
      const Vec3d far = scene.interact(hit, Ray<double>{p, wo}).p;
      EXPECT_EQ(hit.primitive, 1U);
      EXPECT_NEAR((far - p).norm(), -2.0 * magnitude * cosine, 1e-6 * magnitude);
    }
  }
}

// Law: points on an emitter are uniform by area, with the normal of its front.
TEST(EmitterSampling, UniformByArea) {
  Rng rng(135, Stream::Test, 0);
  const int count = 20000;
  const double significance = sidak(0.01, 6);
  const Vec3d corner(0.3, 1, 2);
  const Vec3d u(1, 0.5, 0);
  const Vec3d v(-1.5, 3, 0);
  const Scene rectangle = scene_of(quad(corner, u, v));
  const Disk oval{{1, 2, 3}, {0.5, 0, 0}, {0, 0, 2}};
  const Scene disk = scene_of(oval);
  Sphere ball;
  ball.center = {-1, 0, 4};
  ball.radius = 0.2;
  ball.flip_normals = true;
  const Scene sphere = scene_of(ball);
  std::vector<double> first, second, radius, turn;
  const auto sampled = [&](const Scene& scene) {
    return scene.sample_area(std::get<AreaEmitter>(scene.emitters()[0]), rng.uniform(),
                             rng.uniform());
  };
  for (int i = 0; i < count; ++i) {
    const EmitterPoint on_quad = sampled(rectangle);
    EXPECT_NEAR(on_quad.n.dot(on_quad.p - corner), 0.0, 1e-6);
    EXPECT_LT((on_quad.n - u.cross(v).normalized()).norm(), 1e-6);
    first.push_back(u.dot(on_quad.p - corner) / u.squaredNorm());
    second.push_back(v.dot(on_quad.p - corner) / v.squaredNorm());
    const EmitterPoint on_disk = sampled(disk);
    EXPECT_LT((on_disk.n - oval.u.cross(oval.v).normalized()).norm(), 1e-12);
    const Vec3d offset = on_disk.p - oval.center;
    const Vec2d s(offset.x() / 0.5, offset.z() / 2.0);
    EXPECT_NEAR(offset.y(), 0.0, 1e-12);
    radius.push_back(s.squaredNorm());
    turn.push_back(0.5 + 0.5 * kInvPi * std::atan2(s.y(), s.x()));
    const EmitterPoint on_sphere = sampled(sphere);
    EXPECT_LT((on_sphere.p - (ball.center - ball.radius * on_sphere.n)).norm(), 1e-12);
  }
  for (const auto* numbers : {&first, &second, &radius, &turn})
    EXPECT_GT(chi_square_uniform(*numbers).p_value, significance);
  const SphereGrid grid(Vec3d::UnitY(), 12, 12, 1.0);
  EXPECT_GT(chi_square_directions(
                grid, count, [&] { return sampled(sphere).n; },
                [](const Vec3d&) { return 0.25 * kInvPi; })
                .p_value,
            significance);
  EXPECT_NEAR(rectangle.shapes()[0].extent.area, u.cross(v).norm(), 1e-5);
  EXPECT_NEAR(disk.shapes()[0].extent.area, kPi, 1e-12);
  EXPECT_NEAR(sphere.shapes()[0].extent.area, 4.0 * kPi * 0.04, 1e-12);
}

// Law: points on a cylinder are uniform by height and angle, with the normal of its front.
TEST(EmitterSampling, CylindersByArea) {
  Rng rng(138, Stream::Test, 0);
  Cylinder cylinder;
  cylinder.base = {1, 2, 3};
  cylinder.to_local = Eigen::AngleAxisd(1.1, Vec3d(1, 2, -1).normalized()).toRotationMatrix();
  cylinder.length = 3;
  cylinder.radius = 0.4;
  for (const bool flip : {false, true}) {
    cylinder.flip_normals = flip;
    const Scene scene = scene_of(cylinder);
    std::vector<double> heights, turns;
    for (int i = 0; i < 20000; ++i) {
      const EmitterPoint y = scene.sample_area(std::get<AreaEmitter>(scene.emitters()[0]),
                                               rng.uniform(), rng.uniform());
      const Vec3d local = cylinder.to_local * (y.p - cylinder.base);
      EXPECT_NEAR(std::hypot(local.x(), local.y()), 0.4, 1e-12);
      const Vec3d normal = cylinder.to_local * y.n * (flip ? -0.4 : 0.4);
      EXPECT_LT((normal - Vec3d(local.x(), local.y(), 0.0)).norm(), 1e-12);
      heights.push_back(local.z() / 3.0);
      turns.push_back(0.5 + 0.5 * kInvPi * std::atan2(local.y(), local.x()));
    }
    EXPECT_GT(chi_square_uniform(heights).p_value, sidak(0.01, 4));
    EXPECT_GT(chi_square_uniform(turns).p_value, sidak(0.01, 4));
    EXPECT_NEAR(scene.shapes()[0].extent.area, 2.0 * kPi * 0.4 * 3.0, 1e-12);
  }
}

// Law: a cylinder is open at its ends, and seen from both sides.
TEST(Scene, CylindersAreOpen) {
  const Scene scene = scene_of(Cylinder{.length = 2, .radius = 0.5});
  EXPECT_FALSE(scene.intersect({0, 0, -3}, {0, 0, 1}).valid());
  EXPECT_EQ(scene.intersect({-3, 0, 1}, {1, 0, 0}), (Hit{0, 0}));
  EXPECT_EQ(scene.intersect({0, 0, 1}, {1, 0, 0}), (Hit{0, 1}));
  EXPECT_FALSE(scene.intersect({-3, 0, 2.1}, {1, 0, 0}).valid());
  // Through the opening onto the far wall.
  EXPECT_EQ(scene.intersect({-2, 0, 4}, Vec3d(2.4, 0, -3).normalized()), (Hit{0, 1}));
  EXPECT_TRUE(scene.occluded({-3, 0, 1}, {3, 0, 1}));
}

// Law: a non-planar mesh picks its triangles by area.
TEST(EmitterSampling, TrianglesByArea) {
  Rng rng(136, Stream::Test, 0);
  const TriangleMesh mesh = box({0, 0, 0}, {1, 2, 5});
  const Scene scene = scene_of(mesh);
  std::vector<double> counts(6);
  const int count = 20000;
  for (int i = 0; i < count; ++i) {
    const EmitterPoint y =
        scene.sample_area(std::get<AreaEmitter>(scene.emitters()[0]), rng.uniform(), rng.uniform());
    Eigen::Index axis = 0;
    y.n.cwiseAbs().maxCoeff(&axis);
    counts[static_cast<std::size_t>(2 * axis + (y.n[axis] > 0.0 ? 1 : 0))] += 1.0;
  }
  const double unit = count / 34.0;
  const std::vector<double> expected{10 * unit, 10 * unit, 5 * unit, 5 * unit, 2 * unit, 2 * unit};
  EXPECT_GT(chi_square(counts, expected).p_value, 0.01);
  EXPECT_NEAR(scene.shapes()[0].extent.area, 34.0, 1e-12);
}

// Law: whitened positions of uniform points on a shape have unit covariance in its own dimensions.
TEST(ShapeExtent, WhitensTheCovariance) {
  Rng rng(137, Stream::Test, 0);
  Sphere ball;
  ball.center = {5, 6, 7};
  ball.radius = 0.1;
  const std::vector<Geometry> shapes{
      quad({5, 1, 2}, {0.2, 0.1, 0}, {0, 1, 3}), Disk{{1, 2, 3}, {0.5, 0, 0}, {0, 0, 2}}, ball,
      box({4, 4, 4}, {4.1, 5, 7}), Cylinder{.base = {1, 2, 3}, .length = 0.8, .radius = 0.3}};
  for (const Geometry& shape : shapes) {
    const Scene scene = scene_of(shape);
    const ShapeExtent& extent = scene.shapes()[0].extent;
    const int count = 20000;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    Vec3d mean = Vec3d::Zero();
    double square = 0;
    for (int i = 0; i < count; ++i) {
      const Vec3d p =
          scene
              .sample_area(std::get<AreaEmitter>(scene.emitters()[0]), rng.uniform(), rng.uniform())
              .p;
      const Vec3d w = extent.whitening * (p - extent.centroid);
      covariance += w * w.transpose() / count;
      mean += w / count;
      square += (p - extent.centroid).squaredNorm() / count;
    }
    const int rank = extent.planar ? 2 : 3;
    EXPECT_EQ(extent.planar, &shape < &shapes[2]);
    EXPECT_NEAR(covariance.trace(), rank, 0.06);
    EXPECT_NEAR((covariance * covariance).trace(), rank, 0.12);
    EXPECT_LT(mean.norm(), 0.05);
    EXPECT_NEAR(std::sqrt(square), extent.radius, 0.02 * extent.radius);
  }
}

// Law: the environment map is sampled with the density pdf, which integrates to one and is positive
// wherever there is light.
TEST(EnvironmentMap, SampleFollowsPdf) {
  Rng rng(138, Stream::Test, 0);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Vec3d(1, -2, 0.5).normalized()).toRotationMatrix();
  for (const float sun : {1.0F, 2000.0F}) {
    const EnvironmentMap map(sun_bitmap(16, 8, sun), turn, 0.7);
    // About the sun, which is near texel (width / 3, height / 4) + 1.
    const double phi = 2.0 * kPi * 6.0 / 16.0;
    const double theta = kPi * 3.0 / 8.0;
    const Vec3d at_sun = turn * Vec3d(std::sin(theta) * std::sin(phi), std::cos(theta),
                                      -std::sin(theta) * std::cos(phi));
    const SphereGrid grid(at_sun, 24, 16, 1.5);
    const auto draw = [&] { return map.sample(rng.uniform(), rng.uniform()); };
    const auto density = [&](const Vec3d& d) { return map.pdf(d); };
    const ChiSquareResult result = chi_square_directions(grid, 20000, draw, density);
    EXPECT_GT(result.p_value, 0.005) << sun;
    double mass = 0;
    for (const double cell : grid.integrate(density)) mass += cell;
    EXPECT_NEAR(mass, 1.0, 1e-3);
    for (int i = 0; i < 5000; ++i) {
      const Vec3d d = random_direction(rng);
      if (luminance(map.eval(d)) > 0.0) {
        EXPECT_GT(map.pdf(d), 0.0);
      }
    }
  }
}

// Law: also for maps that are black but for one texel: its light is where the pdf is.
TEST(EnvironmentMap, PdfIsPositiveWhereThereIsLight) {
  Rng rng(139, Stream::Test, 0);
  for (const int lit : {0, 7, 8 * 3 + 5, 8 * 3 + 7}) {
    Bitmap bitmap;
    bitmap.width = 8;
    bitmap.height = 4;
    bitmap.texels.assign(32, Eigen::Array3f::Zero());
    bitmap.texels[static_cast<std::size_t>(lit)] = Eigen::Array3f::Constant(5.0F);
    const EnvironmentMap map(bitmap, Eigen::Matrix3d::Identity(), 1.0);
    int bright = 0;
    for (int i = 0; i < 5000; ++i) {
      const Vec3d d = random_direction(rng);
      if (!(luminance(map.eval(d)) > 0.0)) continue;
      ++bright;
      EXPECT_GT(map.pdf(d), 0.0);
    }
    EXPECT_GT(bright, 50);
    for (int i = 0; i < 1000; ++i) {
      const Vec3d d = map.sample(rng.uniform(), rng.uniform());
      EXPECT_NEAR(d.norm(), 1.0, 1e-12);
      EXPECT_GT(map.pdf(d), 0.0);
    }
  }
}

// Law: the map's directions are those of its documentation, and its texel centres its values.
TEST(EnvironmentMap, DirectionsOfTexels) {
  const Bitmap bitmap = sun_bitmap(16, 8, 50.0F);
  const EnvironmentMap map(bitmap, Eigen::Matrix3d::Identity(), 2.0);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 16; ++x) {
      const double phi = 2.0 * kPi * (x + 0.5) / 16.0;
      const double theta = kPi * (y + 0.5) / 8.0;
      const Vec3d d(std::sin(theta) * std::sin(phi), std::cos(theta),
                    -std::sin(theta) * std::cos(phi));
      const Rgbd expected = 2.0 * bitmap.at(x, y).cast<double>();
      EXPECT_LT((map.eval(d) - expected).abs().maxCoeff(), 1e-9);
    }
  }
}

// Law: emitters are picked by power, black ones never, and probabilities add up to one.
TEST(Scene, PicksEmittersByPower) {
  Rng rng(140, Stream::Test, 0);
  for (const TestScene& test : test_scenes()) {
    const std::size_t count = test.scene.emitters().size();
    std::vector<double> observed(count);
    std::vector<double> expected(count);
    double total = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const double p = test.scene.emitter_probability(i);
      EXPECT_GT(p, 0.0);
      total += p;
      expected[i] = 10000 * p;
    }
    EXPECT_NEAR(total, 1.0, 1e-12);
    for (int i = 0; i < 10000; ++i) {
      double u = rng.uniform();
      observed[test.scene.sample_emitter(u)] += 1.0;
    }
    EXPECT_GT(chi_square(observed, expected).p_value, 0.002) << test.name;
  }
}

// Law: a scene without light, or with a broken mesh, is refused.
TEST(SceneBuilder, RefusesWhatCannotBeRendered) {
  SceneBuilder builder;
  EXPECT_THROW(builder.build(), InputError);
  const auto material = builder.add_material({builder.add_bsdf(Diffuse{}), std::nullopt});
  EXPECT_THROW(builder.add_shape(TriangleMesh{}, material), InputError);
  TriangleMesh broken = quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  broken.triangles[1][2] = 4;
  EXPECT_THROW(builder.add_shape(broken, material), InputError);
  builder.add_shape(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), material, Rgbd::Zero());
  EXPECT_THROW(builder.build(), InputError);
  SceneBuilder twice;
  twice.set_environment(ConstantEnvironment{});
  EXPECT_THROW(twice.set_environment(ConstantEnvironment{}), InputError);
}

}  // namespace
}  // namespace driftlight::test
