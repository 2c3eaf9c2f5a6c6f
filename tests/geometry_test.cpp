// SPDX-License-Identifier: Apache-2.0
/// Laws of interactions: the point is on the ray and on the surface, and normals and texture
/// coordinates belong to it.
#include "driftlight/geometry.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "driftlight/finite_difference.h"
#include "driftlight/random.h"
#include "driftlight/warp.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

Vec3d random_direction(Rng& rng) { return square_to_sphere(rng.uniform(), rng.uniform()); }

/// A ray from somewhere outside to the point p.
Ray<double> ray_to(const Vec3d& p, Rng& rng) {
  const Vec3d origin = p + 5.0 * random_direction(rng);
  return {origin, (p - origin).normalized()};
}

double distance_from_ray(const Ray<double>& ray, const Vec3d& p) {
  return (p - ray.origin).cross(ray.direction).norm();
}

// Law: a ray to the point with barycentric coordinates b meets the triangle there; uv and shading
// normal are the interpolated ones, the geometric normal takes the side of the shading normal.
TEST(Interaction, Triangle) {
  Rng rng(121, Stream::Test, 0);
  for (const bool flipped : {false, true}) {
    TriangleMesh mesh = quad({-1, 0.5, 2}, {2, 0.3, 0}, {0, 1, 1}, true, 0.2);
    if (flipped)
      for (auto& n : mesh.normals) n = -n;
    for (int i = 0; i < 500; ++i) {
      const std::uint32_t triangle = i % 2 == 0 ? 0 : 1;
      const std::array<Vec3d, 3> corner = corners(mesh, triangle);
      double b1 = rng.uniform();
      double b2 = rng.uniform();
      if (b1 + b2 > 1.0) {
        b1 = 1.0 - b1;
        b2 = 1.0 - b2;
      }
      const Vec3d b(1.0 - b1 - b2, b1, b2);
      const Vec3d p = b[0] * corner[0] + b[1] * corner[1] + b[2] * corner[2];
      const Ray<double> ray = ray_to(p, rng);
      const Interaction<double> at = interact(Geometry(mesh), triangle, ray, true);
      EXPECT_LT((at.p - p).norm(), 1e-11);
      Vec3d normal = Vec3d::Zero();
      Vec2d uv = Vec2d::Zero();
      for (std::size_t k = 0; k < 3; ++k) {
        const auto index = mesh.triangles[triangle][k];
        normal += b[static_cast<int>(k)] * mesh.normals[index].cast<double>();
        uv += b[static_cast<int>(k)] * mesh.uvs[index].cast<double>();
      }
      EXPECT_LT((at.n_s - normal.normalized()).norm(), 1e-10);
      EXPECT_LT((at.uv - uv).norm(), 1e-10);
      const Vec3d face = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
      EXPECT_LT((at.n_g - (flipped ? -face : face)).norm(), 1e-12);
      EXPECT_LT((at.n_g - geometric_normal(mesh, triangle)).norm(), 1e-12);
      // Without texture coordinates they are barycentric.
      TriangleMesh bare = mesh;
      bare.uvs.clear();
      bare.normals.clear();
      const Interaction<double> plain = interact(Geometry(bare), triangle, ray, true);
      EXPECT_LT((plain.uv - Vec2d(b1, b2)).norm(), 1e-10);
      EXPECT_LT((plain.n_s - face).norm(), 1e-12);
    }
  }
}

// Law: both roots of the sphere lie on it and on the ray, the first where the ray enters; the
// normal is radial, flipped if asked; uv are the angles in the sphere's own frame.
TEST(Interaction, Sphere) {
  Rng rng(122, Stream::Test, 0);
  Sphere sphere;
  sphere.center = {1, -2, 0.5};
  sphere.radius = 0.7;
  sphere.to_local = Eigen::AngleAxisd(0.8, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
  for (const bool flip : {false, true}) {
    sphere.flip_normals = flip;
    for (int i = 0; i < 500; ++i) {
      const Vec3d n = random_direction(rng);
      const Vec3d p = sphere.center + sphere.radius * n;
      const Ray<double> ray = ray_to(p, rng);
      const std::uint32_t root = ray.direction.dot(n) < 0.0 ? 0 : 1;
      const Interaction<double> at = interact(Geometry(sphere), root, ray, true);
      EXPECT_LT((at.p - p).norm(), 1e-7);
      EXPECT_NEAR((at.p - sphere.center).norm(), sphere.radius, 1e-14);
      EXPECT_LT(distance_from_ray(ray, at.p), 1e-7);
      EXPECT_LT((at.n_g - (flip ? -1.0 : 1.0) * (at.p - sphere.center) / sphere.radius).norm(),
                1e-12);
      EXPECT_EQ(at.n_s, at.n_g);
      const Vec3d local = sphere.to_local * (at.p - sphere.center) / sphere.radius;
      const double phi = 2.0 * kPi * at.uv.x();
      const double theta = kPi * at.uv.y();
      EXPECT_LT((local - Vec3d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                               std::cos(theta)))
                    .norm(),
                1e-7);
      EXPECT_GE(at.uv.x(), 0.0);
      EXPECT_LE(at.uv.x(), 1.0);
    }
  }
}

// Law: an oblique disk is met in its plane, uv = (r, phi) in its axes.
TEST(Interaction, Disk) {
  Rng rng(123, Stream::Test, 0);
  const Disk disk{{0.3, 1, -2}, {0.5, 0.1, 0}, {0.1, 0.2, 0.9}};
  const Vec3d normal = disk.u.cross(disk.v).normalized();
  for (int i = 0; i < 500; ++i) {
    const Vec2d s = square_to_disk(rng.uniform(), rng.uniform());
    const Vec3d p = disk.center + s.x() * disk.u + s.y() * disk.v;
    const Interaction<double> at = interact(Geometry(disk), 0, ray_to(p, rng), true);
    EXPECT_LT((at.p - p).norm(), 1e-10);
    EXPECT_LT((at.n_g - normal).norm(), 1e-12);
    EXPECT_EQ(at.n_s, at.n_g);
    const double phi = 2.0 * kPi * at.uv.y();
    EXPECT_LT((at.uv.x() * Vec2d(std::cos(phi), std::sin(phi)) - s).norm(), 1e-9);
  }
}

Cylinder oblique_cylinder() {
  Cylinder cylinder;
  cylinder.base = {0.3, 1, -0.2};
  cylinder.to_local = Eigen::AngleAxisd(0.9, Vec3d(1, -2, 3).normalized()).toRotationMatrix();
  cylinder.length = 1.7;
  cylinder.radius = 0.6;
  return cylinder;
}

// Law: both roots of the cylinder lie on it and on the ray, the first where the ray enters; the
// normal is radial, flipped if asked; uv are angle and height in the cylinder's own frame.
TEST(Interaction, Cylinder) {
  Rng rng(125, Stream::Test, 0);
  Cylinder cylinder = oblique_cylinder();
  for (const bool flip : {false, true}) {
    cylinder.flip_normals = flip;
    for (int i = 0; i < 500; ++i) {
      const double phi = 2.0 * kPi * rng.uniform();
      const double height = cylinder.length * rng.uniform();
      const Vec3d out = cylinder.to_local.transpose() * Vec3d(std::cos(phi), std::sin(phi), 0.0);
      const Vec3d p = cylinder.base + height * cylinder.axis() + cylinder.radius * out;
      const Ray<double> ray = ray_to(p, rng);
      const std::uint32_t root = ray.direction.dot(out) < 0.0 ? 0 : 1;
      const Interaction<double> at = interact(Geometry(cylinder), root, ray, true);
      EXPECT_LT((at.p - p).norm(), 1e-6);
      EXPECT_LT(distance_from_ray(ray, at.p), 1e-6);
      EXPECT_LT((at.n_g - (flip ? Vec3d(-out) : out)).norm(), 1e-6);
      EXPECT_EQ(at.n_s, at.n_g);
      EXPECT_LT(std::abs(std::remainder(at.uv.x() - phi / (2.0 * kPi), 1.0)), 1e-6);
      EXPECT_NEAR(at.uv.y(), height / cylinder.length, 1e-6);
    }
  }
}

/// A component of an interaction along a line of rays: f(x) for the origin o + x e.
template <class Component>
void check_derivative(const Geometry& geometry, std::uint32_t primitive, const Ray<double>& ray,
                      const Vec3d& shift, const Vec3d& turn, const Component& component) {
  using J = ceres::Jet<double, 1>;
  const J x(0.0, 0);
  const auto moved = [&]<Scalar T>(const T& s) {
    Ray<T> r;
    for (int i = 0; i < 3; ++i) {
      r.origin[i] = ray.origin[i] + s * shift[i];
      r.direction[i] = ray.direction[i] + s * turn[i];
    }
    r.direction = normalized(r.direction);
    return interact(geometry, primitive, r, true);
  };
  const auto f = [&](double s) { return component(moved(s)); };
  const Derivative expected = ridders(f, 1e-3);
  const J actual = component(moved(x));
  EXPECT_NEAR(actual.a, f(0.0), 1e-12);
  EXPECT_NEAR(actual.v[0], expected.value, 1e-7 * (1.0 + std::abs(expected.value)));
}

// Law: a Jet's derivative of point, shading normal and uv is that of the exact surface.
TEST(Interaction, JetsSeeTheSurface) {
  Rng rng(124, Stream::Test, 0);
  Sphere sphere;
  sphere.radius = 1.3;
  const std::vector<Geometry> shapes{quad({-1, -1, 0}, {2, 0.3, 0}, {0, 2, 1}, true, 0.3), sphere,
                                     Disk{{0, 0, 0}, {1, 0.2, 0}, {0, 1, 0.5}},
                                     Cylinder{.base = {0, 0, -1}, .length = 2, .radius = 1.1}};
  for (const Geometry& shape : shapes) {
    for (int i = 0; i < 50; ++i) {
      const Ray<double> ray = ray_to(0.5 * random_direction(rng), rng);
      const Vec3d shift = random_direction(rng);
      const Vec3d turn = random_direction(rng);
      // Away from the seam and the poles of the angles.
      const Interaction<double> at = interact(shape, 0, ray, true);
      if (std::abs(at.uv.y() - 0.5) > 0.4 || std::abs(at.uv.x() - 0.5) > 0.4) continue;
      if (std::abs(at.n_g.dot(ray.direction)) < 0.2) continue;
      for (int k = 0; k < 3; ++k) {
        check_derivative(shape, 0, ray, shift, turn, [k](const auto& a) { return a.p[k]; });
        check_derivative(shape, 0, ray, shift, turn, [k](const auto& a) { return a.n_s[k]; });
      }
      for (int k = 0; k < 2; ++k)
        check_derivative(shape, 0, ray, shift, turn, [k](const auto& a) { return a.uv[k]; });
    }
  }
}

// Law: along the tangent u grows and v stays, on every shape that has texture coordinates.
TEST(TangentField, LiesAlongGrowingU) {
  Rng rng(127, Stream::Test, 0);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.8, Vec3d(1, 2, -1).normalized()).toRotationMatrix();
  const std::vector<Geometry> shapes{
      round_mesh({0.3, -0.2, 0.1}, 1.0, 4), Sphere{{0.3, -0.2, 0.1}, 1.0, turn},
      Disk{{0.2, 0.1, 0}, turn * Vec3d(1.5, 0.2, 0), turn * Vec3d(0.1, 1.1, 0)},
      Cylinder{{0.2, -0.1, 0.3}, turn, 2.0, 0.7}};
  for (const Geometry& shape : shapes) {
    int tried = 0;
    while (tried < 100) {
      const auto* mesh = std::get_if<TriangleMesh>(&shape);
      const auto primitive = static_cast<std::uint32_t>(
          mesh != nullptr ? rng.uniform() * static_cast<double>(mesh->triangles.size()) : 0.0);
      const Ray<double> ray = ray_to(0.5 * random_direction(rng), rng);
      const Vec3d p = interact(shape, primitive, ray, false).p;
      // What lies behind the origin would change sides.
      if (!p.allFinite() || (p - ray.origin).dot(ray.direction) <= 0.0) continue;
      ++tried;
      const Vec3d tangent = tangent_field(shape, primitive).at(p);
      // Near p the ray from the same origin through p + s tangent meets the surface there but for
      // s^2.
      const auto uv = [&](double s) {
        const Vec3d toward = (p + s * tangent - ray.origin).normalized();
        return interact(shape, primitive, Ray<double>{ray.origin, toward}, true).uv;
      };
      const Vec2d slope = (uv(1e-5) - uv(-1e-5)) / 2e-5;
      if (std::abs(slope.x()) > 1e3) continue;  // across the seam of the azimuth
      EXPECT_GT(slope.x(), 0.0);
      EXPECT_NEAR(slope.y(), 0.0, 1e-5 * slope.x());
    }
  }
}

}  // namespace
}  // namespace driftlight::test
