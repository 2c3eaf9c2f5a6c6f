// SPDX-License-Identifier: Apache-2.0
#include "driftlight/scene.h"

#include <embree3/rtcore.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "bsdf_textures.h"
#include "driftlight/error.h"
#include "emission_warp.h"

namespace driftlight {

// ---- Embree ---------------------------------------------------------------------------------

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

Eigen::AlignedBox3d bounds_of(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const auto& p : mesh.positions) box.extend(p.cast<double>());
  return box;
}
Eigen::AlignedBox3d bounds_of(const Sphere& sphere) {
  return {sphere.center.array() - sphere.radius, sphere.center.array() + sphere.radius};
}
Eigen::AlignedBox3d bounds_of(const Disk& disk) {
  const Vec3d half = (disk.u.array().square() + disk.v.array().square()).sqrt();
  return {disk.center - half, disk.center + half};
}
Eigen::AlignedBox3d bounds_of(const Cylinder& cylinder) {
  const Vec3d axis = cylinder.axis();
  const Vec3d half = cylinder.radius * (1.0 - axis.array().square()).max(0.0).sqrt();
  const Vec3d end = cylinder.base + cylinder.length * axis;
  return {cylinder.base.cwiseMin(end) - half, cylinder.base.cwiseMax(end) + half};
}

RTCGeometry embree_geometry(RTCDevice device, const TriangleMesh& mesh) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               mesh.positions.size()));
  for (const auto& p : mesh.positions) vertices = std::copy_n(p.data(), 3, vertices);
  auto* indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), mesh.triangles.size()));
  for (const auto& t : mesh.triangles) indices = std::copy_n(t.data(), 3, indices);
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

// ---- Extents of shapes ----------------------------------------------------------------------

/// Area, centroid and covariance of the uniform distribution on a surface.
struct ShapeMoments {
  double area = 0;
  Vec3d mean = Vec3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// A triangle has E[p p^T] = (s s^T + sum_i p_i p_i^T) / 12 with s = p_0 + p_1 + p_2.
ShapeMoments moments(const TriangleMesh& mesh) {
  const Vec3d origin = mesh.positions.front().cast<double>();
  ShapeMoments m;
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::array<Vec3d, 3> p = corners(mesh, i);
    const double area = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
    Vec3d sum = Vec3d::Zero();
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    for (const Vec3d& corner : p) {
      const Vec3d q = corner - origin;
      sum += q;
      products += q * q.transpose();
    }
    m.area += area;
    m.mean += area / 3.0 * sum;
    second += area / 12.0 * (sum * sum.transpose() + products);
  }
  m.mean /= m.area;
  m.covariance = second / m.area - m.mean * m.mean.transpose();
  m.mean += origin;
  return m;
}

ShapeMoments moments(const Sphere& sphere) {
  const double r2 = sphere.radius * sphere.radius;
  return {4.0 * kPi * r2, sphere.center, Eigen::Matrix3d::Identity() * (r2 / 3.0)};
}

ShapeMoments moments(const Disk& disk) {
  return {kPi * disk.u.cross(disk.v).norm(), disk.center,
          0.25 * (disk.u * disk.u.transpose() + disk.v * disk.v.transpose())};
}

ShapeMoments moments(const Cylinder& cylinder) {
  const Vec3d axis = cylinder.axis();
  const double across2 = 0.5 * cylinder.radius * cylinder.radius;
  const double along2 = cylinder.length * cylinder.length / 12.0;
  return {2.0 * kPi * cylinder.radius * cylinder.length,
          cylinder.base + 0.5 * cylinder.length * axis,
          across2 * Eigen::Matrix3d::Identity() + (along2 - across2) * axis * axis.transpose()};
}

ShapeExtent extent_of(const Geometry& geometry) {
  const ShapeMoments m = std::visit([](const auto& shape) { return moments(shape); }, geometry);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(m.covariance);
  const Vec3d variance = axes.eigenvalues().cwiseMax(0.0);
  ShapeExtent extent;
  extent.area = m.area;
  extent.centroid = m.mean;
  extent.radius = std::sqrt(variance.sum());
  // Positions are floats: what is thinner than their rounding is flat.
  const double thinnest = 1e-10 * variance.maxCoeff();
  extent.planar = variance.x() <= thinnest;
  for (int i = 0; i < 3; ++i)
    if (variance[i] > thinnest)
      extent.whitening.row(i) = axes.eigenvectors().col(i).transpose() / std::sqrt(variance[i]);
  return extent;
}

/// False if uv are not one linear function over the plane of the mesh.
bool has_linear_uv(const TriangleMesh& mesh) {
  constexpr double kTolerance = 1e-4;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::array<Vec3d, 3> corner = corners(mesh, i);
    for (int j = 0; j < 3; ++j) {
      const Vec2d own = triangle_uv<double>(mesh, i, j == 1 ? 1.0 : 0.0, j == 2 ? 1.0 : 0.0);
      const Vec2d first = triangle_uv(mesh, 0, corner[static_cast<std::size_t>(j)]);
      if (!((own - first).cwiseAbs().maxCoeff() <= kTolerance)) return false;
    }
  }
  return true;
}

DiscreteDistribution triangles_by_area(const TriangleMesh& mesh) {
  std::vector<double> areas;
  areas.reserve(mesh.triangles.size());
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::array<Vec3d, 3> p = corners(mesh, i);
    areas.push_back(0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm());
  }
  return DiscreteDistribution(areas);
}

}  // namespace

// ---- Scene ----------------------------------------------------------------------------------

Scene::Scene() : surfaces_(std::make_shared<Surfaces>()) {}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

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

Vec3d Scene::leave(const Vec3d& p, const Vec3d& n_g, const Vec3d& direction) const {
  // Rounding to float moves a point by 6e-8 of its largest coordinate; Embree's plane equations
  // lose a few bits more.
  const double offset = 4e-6 * (p.cwiseAbs().maxCoeff() + 1e-2 * radius_);
  return p + (n_g.dot(direction) > 0.0 ? offset : -offset) * n_g;
}

EmitterPoint Scene::sample_area(const AreaEmitter& emitter, double u1, double u2) const {
  return warp_area<double>(shapes()[emitter.shape], u1, u2);
}

namespace {

/// Power of an emitter up to a common factor; only the choice of emitters depends on it.
double power(const Emitter& emitter, std::span<const Shape> shapes, double scene_radius) {
  struct Visitor {
    std::span<const Shape> shapes;
    double disk;
    double operator()(const AreaEmitter& e) const {
      return luminance(e.radiance) * shapes[e.shape].extent.area * kPi;
    }
    double operator()(const PointEmitter& e) const {
      return luminance(e.intensity) * e.solid_angle();
    }
    double operator()(const SpotEmitter& e) const {
      return luminance(e.intensity()) * e.solid_angle();
    }
    double operator()(const DirectionalEmitter& e) const { return luminance(e.irradiance) * disk; }
    double operator()(const ConstantEnvironment& e) const {
      return luminance(e.radiance) * 4.0 * kPi * disk;
    }
    double operator()(const EnvironmentMap& e) const { return e.total_luminance() * disk; }
    double operator()(const BlurredAreaEmitter&) const { return 0.0; }
  };
  return std::visit(Visitor{shapes, kPi * scene_radius * scene_radius}, emitter);
}

}  // namespace

void Scene::choose_emitters_by_power() {
  std::vector<double> powers;
  for (const Emitter& emitter : emitters_) powers.push_back(power(emitter, shapes(), radius_));
  emitter_choice_ = DiscreteDistribution(powers);
}

Scene Scene::with_emitters(std::vector<Emitter> emitters) const {
  Scene scene;
  scene.camera_ = camera_;
  scene.surfaces_ = surfaces_;
  scene.emitters_ = std::move(emitters);
  scene.environment_ = environment_;
  scene.center_ = center_;
  scene.radius_ = radius_;
  scene.accelerator_ = accelerator_;
  scene.choose_emitters_by_power();
  return scene;
}

// ---- SceneBuilder ---------------------------------------------------------------------------

std::uint32_t SceneBuilder::add_bsdf(Bsdf bsdf) {
  if (lobe_count(bsdf) > kMaxLobes)
    throw InputError("a bsdf of " + std::to_string(lobe_count(bsdf)) + " lobes; the limit is " +
                     std::to_string(kMaxLobes));
  scene_.surfaces_->bsdfs.push_back(std::move(bsdf));
  return static_cast<std::uint32_t>(scene_.surfaces_->bsdfs.size() - 1);
}

std::uint32_t SceneBuilder::add_material(const Material& material) {
  scene_.surfaces_->materials.push_back(material);
  return static_cast<std::uint32_t>(scene_.surfaces_->materials.size() - 1);
}

namespace {

std::shared_ptr<const Texture> divided(const Texture& texture, const Rgbd& by) {
  auto result = std::make_shared<Texture>(texture);
  result->scale *= (by > 0.0).select(1.0 / by, 1.0);
  return result;
}

}  // namespace

std::uint32_t SceneBuilder::add_shape(Geometry geometry, std::uint32_t material,
                                      const Texture& radiance) {
  const Rgbd mean = radiance.average();
  const Rgbd unit = (mean > 0.0).select(mean, radiance.maximum_color());
  const std::uint32_t index = add_shape(std::move(geometry), material, unit);
  if (!radiance.is_constant())
    std::get<AreaEmitter>(scene_.emitters_.back()).texture = divided(radiance, unit);
  return index;
}

std::uint32_t SceneBuilder::add_shape(Geometry geometry, std::uint32_t material,
                                      std::optional<Rgbd> radiance) {
  if (const auto* mesh = std::get_if<TriangleMesh>(&geometry)) {
    if (mesh->triangles.empty()) throw InputError("a mesh without triangles");
    for (const auto& triangle : mesh->triangles)
      for (const std::uint32_t i : triangle)
        if (i >= mesh->positions.size())
          throw InputError("a triangle's vertex index " + std::to_string(i) +
                           " is beyond the mesh's " + std::to_string(mesh->positions.size()) +
                           " vertices");
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&geometry)) {
    // The extent of one that is thinner or flatter has fewer dimensions than its surface.
    const double slenderness = cylinder->length / cylinder->radius;
    if (radiance && !(slenderness > 1e-4 && slenderness < 1e4))
      throw InputError(
          "an emitting cylinder must not be more than 10000 times as long as its "
          "radius, nor the reverse");
  }
  const std::shared_ptr<const Relief>& relief = scene_.surfaces_->materials.at(material).relief;
  if (relief != nullptr) {
    const auto* mesh = std::get_if<TriangleMesh>(&geometry);
    if (mesh == nullptr || mesh->uvs.empty())
      throw InputError("bump and normal maps need a mesh with texture coordinates");
  }
  const auto index = static_cast<std::uint32_t>(scene_.surfaces_->shapes.size());
  Shape shape;
  shape.relief = relief;
  shape.geometry = std::move(geometry);
  shape.material = material;
  if (radiance) {
    shape.emitter = static_cast<std::uint32_t>(scene_.emitters_.size());
    scene_.emitters_.emplace_back(AreaEmitter{*radiance, index, nullptr});
  }
  scene_.surfaces_->shapes.push_back(std::move(shape));
  return index;
}

void SceneBuilder::add_emitter(PointEmitter emitter) { scene_.emitters_.emplace_back(emitter); }
void SceneBuilder::add_emitter(SpotEmitter emitter) { scene_.emitters_.emplace_back(emitter); }
void SceneBuilder::add_emitter(DirectionalEmitter emitter) {
  scene_.emitters_.emplace_back(emitter);
}

void SceneBuilder::set_environment(Emitter environment) {
  if (scene_.environment_) throw InputError("a scene can have one environment emitter only");
  scene_.environment_ = static_cast<std::uint32_t>(scene_.emitters_.size());
  scene_.emitters_.push_back(std::move(environment));
}

void SceneBuilder::set_camera(const Camera& camera) { scene_.camera_ = camera; }

Scene SceneBuilder::build() {
  Scene& scene = scene_;
  if (scene.emitters_.empty()) throw InputError("the scene has no emitter");
  Eigen::AlignedBox3d box;
  for (Shape& shape : scene.surfaces_->shapes) {
    shape.extent = extent_of(shape.geometry);
    const Material& material = scene.surfaces_->materials.at(shape.material);
    shape.textured = shape.relief != nullptr ||
                     is_textured(scene.surfaces_->bsdfs.at(material.front)) ||
                     (material.back && is_textured(scene.surfaces_->bsdfs.at(*material.back)));
    if (shape.emitter) {
      const bool emits_texture =
          std::get<AreaEmitter>(scene.emitters_[*shape.emitter]).texture != nullptr;
      shape.textured |= emits_texture;
      if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry)) {
        shape.triangles = triangles_by_area(*mesh);
        shape.bent_emission = emits_texture && !has_linear_uv(*mesh);
      }
    }
    box.extend(std::visit([](const auto& s) { return bounds_of(s); }, shape.geometry));
  }
  for (const Emitter& emitter : scene.emitters_)
    if (is_point(emitter)) box.extend(position_of(emitter));
  if (!box.isEmpty()) {
    scene.center_ = box.center();
    scene.radius_ = 0.5 * box.diagonal().norm();
  }
  scene.choose_emitters_by_power();
  if (!scene.samples_emitters()) throw InputError("all emitters of the scene are black");

  // User geometries point into the shapes, which do not move from here on.
  const auto accelerator = std::make_shared<Scene::Accelerator>();
  scene.accelerator_ = accelerator;
  for (const Shape& shape : scene.surfaces_->shapes) {
    RTCGeometry geometry = std::visit(
        [&](const auto& s) { return embree_geometry(accelerator->device, s); }, shape.geometry);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(accelerator->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(accelerator->scene);
  if (rtcGetDeviceError(accelerator->device) != RTC_ERROR_NONE)
    throw RuntimeError("Embree could not build the scene");
  return std::move(scene_);
}

}  // namespace driftlight
