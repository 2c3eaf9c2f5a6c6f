// SPDX-License-Identifier: Apache-2.0
/// How emitters turn numbers into points and rays, for every Scalar. Which triangle of a mesh and
/// which patch of a map it is are discrete choices, made by values.
#pragma once

#include <algorithm>
#include <cmath>

#include "driftlight/scene.h"

namespace driftlight {

/// The point of a sphere with the outward normal n.
template <Scalar T>
EmitterPointOf<T> sphere_point(const Shape& shape, const Sphere& sphere, const Vec3<T>& n) {
  EmitterPointOf<T> y{constant<T>(sphere.center) + constant<T>(sphere.radius) * n,
                      sphere.flip_normals ? Vec3<T>(-n) : n};
  if (shape.textured) y.uv = sphere_uv(sphere, n);
  return y;
}

/// Uniform point on the shape of an area emitter, density 1 / area.
template <Scalar T>
EmitterPointOf<T> warp_area(const Shape& shape, T u1, const T& u2) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  if (const auto* sphere = std::get_if<Sphere>(&shape.geometry)) {
    return sphere_point(shape, *sphere, square_to_sphere(u1, u2));
  }
  if (const auto* disk = std::get_if<Disk>(&shape.geometry)) {
    const Vec2<T> s = square_to_disk(u1, u2);
    EmitterPointOf<T> y{
        constant<T>(disk->center) + s.x() * constant<T>(disk->u) + s.y() * constant<T>(disk->v),
        constant<T>(Vec3d(disk->u.cross(disk->v).normalized()))};
    if (shape.textured) y.uv = disk_uv(*disk, y.p);
    return y;
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&shape.geometry)) {
    const T phi = 2.0 * kPi * u2;
    const Vec3<T> n = scaled(constant<T>(Vec3d(cylinder->to_local.row(0))), T(cos(phi))) +
                      scaled(constant<T>(Vec3d(cylinder->to_local.row(1))), T(sin(phi)));
    const Vec3<T> p = constant<T>(cylinder->base) +
                      T(u1 * cylinder->length) * constant<T>(cylinder->axis()) +
                      constant<T>(cylinder->radius) * n;
    return {p, cylinder->flip_normals ? Vec3<T>(-n) : n, {u2, u1}};
  }
  const auto& mesh = std::get<TriangleMesh>(shape.geometry);
  const auto i = static_cast<std::uint32_t>(shape.triangles.sample(u1));
  const std::array<Vec3d, 3> p = corners(mesh, i);
  const T root = sqrt(u1);
  const T b1 = root * (1.0 - u2);
  const T b2 = root * u2;
  const Vec3<T> point = constant<T>(p[0]) + b1 * constant<T>(Vec3d(p[1] - p[0])) +
                        b2 * constant<T>(Vec3d(p[2] - p[0]));
  EmitterPointOf<T> y{point, constant<T>(geometric_normal(mesh, i))};
  if (shape.textured) y.uv = triangle_uv(mesh, i, b1, b2);
  return y;
}

/// Direction toward an environment.
template <Scalar T>
Vec3<T> warp_environment(const Emitter& environment, const T& u1, const T& u2) {
  if (const auto* map = std::get_if<EnvironmentMap>(&environment)) return map->sample(u1, u2);
  return square_to_sphere(u1, u2);
}

/// A ray that leaves an emitter, as emission.h says which numbers make it.
template <Scalar T>
struct EmittedRay {
  EmitterPointOf<T> from;  ///< n is zero of emitters without surface
  Vec3<T> direction;
  T cosine;  ///< with n
};

/// Points of a sphere seen along v are drawn by their place across it, uniformly on a disk: the
/// direction is uniform, and the point has density cos / (pi R^2). That is the density of a uniform
/// point with a direction by the cosine, cos / (4 pi^2 R^2).
template <Scalar T>
EmittedRay<T> warp_emission_from_sphere(const Shape& shape, const Sphere& sphere,
                                        const std::array<T, 4>& u) {
  const Vec3<T> v = square_to_sphere(u[0], u[1]);
  const Vec2<T> disk = square_to_disk(u[2], u[3]);
  const T cosine = root_or_zero(T(1.0 - (disk.x() * disk.x() + disk.y() * disk.y())));
  const double side = sphere.flip_normals ? -1.0 : 1.0;
  const Vec3<T> n = to_world<T>({disk.x(), disk.y(), side * cosine}, v);
  return {sphere_point(shape, sphere, n), v, cosine};
}

template <Scalar T>
EmittedRay<T> warp_emission_from_area(const Shape& shape, const std::array<T, 4>& u) {
  if (const auto* sphere = std::get_if<Sphere>(&shape.geometry))
    return warp_emission_from_sphere(shape, *sphere, u);
  const EmitterPointOf<T> point = warp_area(shape, u[0], u[1]);
  const Vec3<T> local = square_to_cosine_hemisphere(u[2], u[3]);
  return {point, to_world<T>(local, point.n), local.z()};
}

/// From a point or spot.
template <Scalar T>
EmittedRay<T> warp_emission_from_point(const Emitter& emitter, const std::array<T, 4>& u) {
  const auto* spot = std::get_if<SpotEmitter>(&emitter);
  return {{.p = constant<T>(position_of(emitter))},
          spot == nullptr ? square_to_sphere(u[2], u[3]) : spot->sample(u[2], u[3]),
          constant<T>(1.0)};
}

/// From the disk that touches the bounding sphere, across the ray from the direction `toward`.
template <Scalar T>
EmittedRay<T> warp_emission_from_infinity(const Scene& scene, const Vec3<T>& toward,
                                          const std::array<T, 4>& u) {
  const Vec2<T> disk = square_to_disk(u[2], u[3]);
  const Vec3<T> offset = to_world<T>({disk.x(), disk.y(), constant<T>(1.0)}, toward);
  return {{.p = constant<T>(scene.center()) + constant<T>(scene.radius()) * offset},
          -toward,
          constant<T>(1.0)};
}

}  // namespace driftlight
