// SPDX-License-Identifier: Apache-2.0
// All that knows of Embree.
#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "driftlight/error.h"
#include "driftlight/scene.h"
#include "shape_extent.h"

namespace driftlight {

struct Scene::Accelerator {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  Accelerator() : device(rtcNewDevice("threads=0,set_affinity=0")) {
    if (device == nullptr) throw RuntimeError("Embree cannot be initialised on this machine");
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  }
  Accelerator(const Accelerator&) = delete;
  Accelerator& operator=(const Accelerator&) = delete;
  ~Accelerator() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
};

namespace {

/// Roots of a quadric shape along a ray, in increasing t. `primitive` as Hit has it.
struct Roots {
  int count = 0;
  std::array<double, 2> t{};
};

Roots roots(const Sphere& sphere, const Vec3d& origin, const Vec3d& direction) {
  const Vec3d oc = origin - sphere.center;
  const double b = oc.dot(direction);
  const double discriminant = b * b - (oc.squaredNorm() - sphere.radius * sphere.radius);
  if (discriminant < 0.0) return {};
  const double root = std::sqrt(discriminant);
  return {2, {-b - root, -b + root}};
}

Roots roots(const Disk& disk, const Vec3d& origin, const Vec3d& direction) {
  const Vec3d n = disk.u.cross(disk.v);
  const double t = n.dot(disk.center - origin) / n.dot(direction);
  const Vec3d p = origin + t * direction - disk.center;
  const double n2 = n.squaredNorm();
  const double s = disk.v.cross(n).dot(p) / n2;
  const double q = n.cross(disk.u).dot(p) / n2;
  if (!(s * s + q * q <= 1.0)) return {};
  return {1, {t, 0}};
}

Roots roots(const Cylinder& cylinder, const Vec3d& origin, const Vec3d& direction) {
  const Vec3d oc = origin - cylinder.base;
  const Vec3d o = cylinder.across(oc);
  const Vec3d d = cylinder.across(direction);
  const double b = o.dot(d) / d.squaredNorm();
  const double across2 = cylinder.radius * cylinder.radius - (o - b * d).squaredNorm();
  if (!(across2 >= 0.0 && d.squaredNorm() > 0.0)) return {};
  const double root = std::sqrt(across2 / d.squaredNorm());
  Roots found{2, {-b - root, -b + root}};
  const Vec3d axis = cylinder.axis();
  for (double& t : found.t) {
    const double z = axis.dot(oc) + t * axis.dot(direction);
    // The index of a root names it, so one that is beyond the ends stays, out of every interval.
    if (!(z >= 0.0 && z <= cylinder.length)) t = -std::numeric_limits<double>::infinity();
  }
  return found;
}

/// First root within the ray's interval, as (index, t).
template <class Shape, class RayType>
std::optional<std::pair<unsigned, double>> first_root(const Shape& shape, const RayType& ray) {
  const Vec3d origin(static_cast<double>(ray.org_x), static_cast<double>(ray.org_y),
                     static_cast<double>(ray.org_z));
  const Vec3d direction(static_cast<double>(ray.dir_x), static_cast<double>(ray.dir_y),
                        static_cast<double>(ray.dir_z));
  // The direction is a unit vector of floats: measure t along it as Embree does.
  const double length = direction.norm();
  const Roots found = roots(shape, origin, direction / length);
  for (int i = 0; i < found.count; ++i) {
    const double t = found.t[static_cast<std::size_t>(i)] / length;
    if (t > static_cast<double>(ray.tnear) && t < static_cast<double>(ray.tfar))
      return std::pair{static_cast<unsigned>(i), t};
  }
  return std::nullopt;
}

/// Embree's callbacks for a shape that is solved in double.
template <class Shape>
struct UserShape {
  static void intersect(const RTCIntersectFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    auto* ray = reinterpret_cast<RTCRayHit*>(args->rayhit);
    const auto root = first_root(*static_cast<const Shape*>(args->geometryUserPtr), ray->ray);
    if (!root) return;
    ray->ray.tfar = static_cast<float>(root->second);
    ray->hit.geomID = args->geomID;
    ray->hit.primID = root->first;
    ray->hit.instID[0] = args->context->instID[0];
  }
  static void occluded(const RTCOccludedFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    auto* ray = reinterpret_cast<RTCRay*>(args->ray);
    if (first_root(*static_cast<const Shape*>(args->geometryUserPtr), *ray))
      ray->tfar = -std::numeric_limits<float>::infinity();
  }
};

/// Bounds rounded outward.
RTCBounds to_bounds(const Eigen::AlignedBox3d& box) {
  const auto down = [](double x) {
    return std::nextafter(static_cast<float>(x), -std::numeric_limits<float>::infinity());
  };
  const auto up = [](double x) {
    return std::nextafter(static_cast<float>(x), std::numeric_limits<float>::infinity());
  };
  RTCBounds bounds{};
  bounds.lower_x = down(box.min().x());
  bounds.lower_y = down(box.min().y());
  bounds.lower_z = down(box.min().z());
  bounds.upper_x = up(box.max().x());
  bounds.upper_y = up(box.max().y());
  bounds.upper_z = up(box.max().z());
  return bounds;
}

/// Of indices Embree takes those of the mesh, which like user geometries outlives it here; vertices
/// it reads in sixteens of bytes, beyond the last one.
RTCGeometry embree_geometry(RTCDevice device, const TriangleMesh& mesh) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               mesh.positions.size()));
  for (const auto& p : mesh.positions) vertices = std::copy_n(p.data(), 3, vertices);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                             mesh.triangles.data(), 0, sizeof mesh.triangles.front(),
                             mesh.triangles.size());
  return geometry;
}

template <class Shape>
RTCGeometry embree_geometry(RTCDevice device, const Shape& shape) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(geometry, 1);
  rtcSetGeometryUserData(geometry, const_cast<Shape*>(&shape));
  rtcSetGeometryBoundsFunction(
      geometry,
      [](const RTCBoundsFunctionArguments* args) {
        *args->bounds_o = to_bounds(bounds_of(*static_cast<const Shape*>(args->geometryUserPtr)));
      },
      nullptr);
  rtcSetGeometryIntersectFunction(geometry, &UserShape<Shape>::intersect);
  rtcSetGeometryOccludedFunction(geometry, &UserShape<Shape>::occluded);
  return geometry;
}

RTCRay embree_ray(const Vec3d& origin, const Vec3d& direction, double t_min, double t_max) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = static_cast<float>(t_min);
  ray.tfar = static_cast<float>(t_max);
  ray.mask = ~0U;
  return ray;
}

}  // namespace

std::shared_ptr<const Scene::Accelerator> Scene::accelerate(const std::vector<Shape>& shapes) {
  auto accelerator = std::make_shared<Accelerator>();
  for (const Shape& shape : shapes) {
    RTCGeometry geometry = std::visit(
        [&](const auto& s) { return embree_geometry(accelerator->device, s); }, shape.geometry);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(accelerator->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(accelerator->scene);
  if (rtcGetDeviceError(accelerator->device) != RTC_ERROR_NONE)
    throw RuntimeError("Embree could not build the scene");
  return accelerator;
}

Hit Scene::intersect(const Vec3d& origin, const Vec3d& direction, double t_min,
                     double t_max) const {
  RTCRayHit query{};
  query.ray = embree_ray(origin, direction, t_min, t_max);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(accelerator_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {query.hit.geomID, query.hit.primID};
}

bool Scene::occluded(const Vec3d& a, const Vec3d& b) const {
  const Vec3d d = b - a;
  const double length = d.norm();
  RTCRay ray = embree_ray(a, d / length, 0.0, length);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(accelerator_->scene, &context, &ray);
  return ray.tfar < 0.0F;
}

bool Scene::occluded_to_infinity(const Vec3d& origin, const Vec3d& direction) const {
  RTCRay ray = embree_ray(origin, direction, 0.0, std::numeric_limits<double>::infinity());
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(accelerator_->scene, &context, &ray);
  return ray.tfar < 0.0F;
}

}  // namespace driftlight
