// SPDX-License-Identifier: Apache-2.0
/// Laws of the cameras' rays.
#include "driftlight/sensor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "driftlight/random.h"
#include "support/test_scenes.h"

namespace driftlight {
namespace {

std::vector<Camera> cameras() {
  std::vector<Camera> result(3, test::look_at({0.3, 1.4, 2.5}, {-0.2, 0.4, 0}, 0.5));
  for (Camera& camera : result) {
    camera.half_height = 0.3;
    camera.center = {0.1, -0.2};
  }
  result[1].projection = Camera::Projection::Orthographic;
  result[1].scale = 3.7;
  result[2].lens_radius = 0.4;
  result[2].focus_depth = 1.7;
  return result;
}

// Law: all points on the ray of a film point have its coordinate, and the depth at which they lie.
TEST(Camera, PointsHaveTheCoordinateOfTheirRay) {
  Rng rng(1, Stream::Test, 0);
  for (const Camera& camera : cameras()) {
    for (int i = 0; i < 20; ++i) {
      const Vec2d film = rng.uniform2();
      const Vec3d lens = camera.lens_point(rng.uniform2());
      const Vec3d v = camera.direction(film, lens);
      const Ray<double> ray = camera.ray(v, lens);
      EXPECT_NEAR(ray.direction.norm(), 1.0, 1e-14);
      const double depth = 0.1 + 5.0 * rng.uniform();
      const Vec3d p = ray.origin + depth / camera.cosine(ray.direction) * ray.direction;
      EXPECT_NEAR(camera.depth(p), depth, 1e-13);
      EXPECT_LT((camera.coordinate(p, lens) - v).norm(), 1e-13);
      EXPECT_LT((camera.film_position(v, lens) - film).norm(), 1e-13);
    }
  }
}

// Law: an orthographic camera sees with the same weight all over its film.
TEST(Camera, ParallelRaysHaveOneDensity) {
  const Camera camera = cameras()[1];
  const double area = camera.area() * camera.scale * camera.scale;
  for (const Vec2d& film : {Vec2d(0.5, 0.5), Vec2d(0.02, 0.9)}) {
    const Vec3d v = camera.direction(film);
    const double spread = camera.spread(v, Vec3d(0.1, 0.2, 0.3), camera.origin);
    EXPECT_NEAR(std::exp(camera.log_importance(v)) / spread, 1.0 / area, 1e-12 / area);
  }
}

// Law: the spread is the area across the rays that a small solid angle about the coordinate covers.
TEST(Camera, SpreadIsAreaBySolidAngle) {
  Rng rng(2, Stream::Test, 0);
  const double h = 1e-5;
  for (const Camera& camera : cameras()) {
    const Vec3d lens = camera.lens_point(rng.uniform2());
    const Vec3d v = camera.direction(rng.uniform2(), lens);
    const Ray<double> ray = camera.ray(v, lens);
    const Vec3d p = ray.origin + 2.3 * ray.direction;
    const auto crossing = [&](const Vec3d& w) -> Vec3d {
      const Ray<double> other = camera.ray<double>(w.normalized(), lens);
      const double t = ray.direction.dot(p - other.origin) / ray.direction.dot(other.direction);
      return other.origin + t * other.direction;
    };
    const TangentBasis basis = tangent_basis(v);
    const Vec3d dt = crossing(v + h * basis.t) - crossing(v - h * basis.t);
    const Vec3d db = crossing(v + h * basis.b) - crossing(v - h * basis.b);
    const double spread = camera.spread(v, p, lens);
    EXPECT_NEAR(dt.cross(db).norm() / (4.0 * h * h), spread, 1e-6 * spread);
  }
}

// Law: a lens shows at each film point, from everywhere, what the pinhole sees there at the depth
// of focus; its points are uniform.
TEST(Camera, LensIsInFocusAtOneDepth) {
  const Camera pinhole = cameras()[0];
  const Camera camera = cameras()[2];
  Rng rng(3, Stream::Test, 0);
  double inside = 0;
  for (int i = 0; i < 1000; ++i) {
    const Vec2d film = rng.uniform2();
    const Vec3d through_center = pinhole.direction(film);
    const Vec3d focus =
        camera.origin + camera.focus_depth / camera.cosine(through_center) * through_center;
    const Vec3d lens = camera.lens_point(rng.uniform2());
    EXPECT_NEAR(camera.depth(lens), 0.0, 1e-14);
    EXPECT_TRUE(camera.is_on_lens(lens));
    EXPECT_LT((camera.direction(film, lens) - (focus - lens).normalized()).norm(), 1e-13);
    if ((lens - camera.origin).norm() < 0.5 * camera.lens_radius) inside += 1e-3;
  }
  EXPECT_NEAR(inside, 0.25, 0.05);
  EXPECT_NEAR(camera.lens_density() * kPi * 0.4 * 0.4, 1.0, 1e-14);
}

TEST(Camera, DifferentialOfAnOrthographicOrigin) {
  const Camera camera = cameras()[1];
  const Vec3d v = camera.direction(Vec2d(0.2, 0.7));
  const TangentBasis basis = tangent_basis(v);
  const double h = 1e-6;
  for (const Vec3d& dv : {basis.t, basis.b}) {
    const Vec3d after = camera.ray<double>((v + h * dv).normalized(), camera.origin).origin;
    const Vec3d before = camera.ray<double>((v - h * dv).normalized(), camera.origin).origin;
    const Vec3d differential = camera.origin_differential(v, dv);
    EXPECT_LT(((after - before) / (2.0 * h) - differential).norm(), 1e-8);
    const Vec3d x(0.3, -1.2, 0.8);
    EXPECT_NEAR(x.dot(differential), camera.origin_adjoint(v, x).dot(dv), 1e-14);
  }
}

}  // namespace
}  // namespace driftlight
