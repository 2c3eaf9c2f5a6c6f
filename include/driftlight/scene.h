// SPDX-License-Identifier: Apache-2.0
/// The scene: immutable once built; the only owner of Embree.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "driftlight/bsdf.h"
#include "driftlight/emitter.h"
#include "driftlight/geometry.h"
#include "driftlight/relief.h"
#include "driftlight/sensor.h"
#include "driftlight/warp.h"

namespace driftlight {

/// BSDFs (by index) on the two sides of a surface. A transmissive BSDF serves both sides and stands
/// in `front` alone. No back: the back side is black.
struct Material {
  std::uint32_t front = 0;
  std::optional<std::uint32_t> back;
  /// Of the surface, seen as it is from either side; null: none.
  std::shared_ptr<const Relief> relief = nullptr;
};

/// What constraints and emitter sampling know of a shape, computed when the scene is built.
struct ShapeExtent {
  double area = 0;
  Vec3d centroid{0, 0, 0};  ///< of the area
  /// Rows that whiten the covariance of a uniform point on the shape: |W (p - centroid)|^2 has
  /// mean 2 or 3. Rows of directions in which the shape has no extent are zero.
  Eigen::Matrix3d whitening = Eigen::Matrix3d::Zero();
  /// Root mean square distance from the centroid.
  double radius = 0;
  bool planar = false;
};

struct Shape {
  Geometry geometry;
  std::uint32_t material = 0;
  std::optional<std::uint32_t> emitter;
  ShapeExtent extent;
  bool textured = false;     ///< something of the material or of the emission looks at uv
  bool anisotropic = false;  ///< something of the material looks at the tangent
  /// The emission looks at the uv of a mesh that are not one linear function of the point.
  bool bent_emission = false;
  std::shared_ptr<const Relief> relief;  ///< of the material; only of meshes
  DiscreteDistribution triangles;        ///< by area; only for meshes that emit
};

/// A point drawn on an emitter, for a connection.
template <Scalar T>
struct EmitterPointOf {
  Vec3<T> p = constant<T>(Vec3d(Vec3d::Zero()));
  /// Unit normal on the emitting side; zero for points and spots.
  Vec3<T> n = constant<T>(Vec3d(Vec3d::Zero()));
  Vec2<T> uv = constant<T>(Vec2d(Vec2d::Zero()));  ///< zero if the emitter is not textured
};
using EmitterPoint = EmitterPointOf<double>;

class Scene {
 public:
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  const Camera& camera() const { return camera_; }
  std::span<const Shape> shapes() const { return surfaces_->shapes; }
  std::span<const Material> materials() const { return surfaces_->materials; }
  std::span<const Bsdf> bsdfs() const { return bsdfs_; }
  std::span<const Emitter> emitters() const { return emitters_; }
  std::optional<std::uint32_t> environment() const { return environment_; }
  /// Bounding sphere of all shapes and finite emitters.
  const Vec3d& center() const { return center_; }
  double radius() const { return radius_; }

  /// Nearest hit of the ray from `origin` along the unit `direction`, t in (t_min, t_max). If the
  /// origin lies on a surface with geometric normal n_g, pass origin = leave(p, n_g, direction).
  Hit intersect(const Vec3d& origin, const Vec3d& direction, double t_min = 0.0,
                double t_max = std::numeric_limits<double>::infinity()) const;
  /// True if something lies between a and b, both already moved off their surfaces.
  bool occluded(const Vec3d& a, const Vec3d& b) const;
  /// True if something lies on the ray to infinity.
  bool occluded_to_infinity(const Vec3d& origin, const Vec3d& direction) const;
  /// p moved off its surface, to the side into which `direction` leaves, by more than the rounding
  /// of single-precision rays and by less than anything visible.
  Vec3d leave(const Vec3d& p, const Vec3d& n_g, const Vec3d& direction) const;

  /// The point where the ray meets the primitive of a valid hit.
  template <Scalar T>
  Interaction<T> interact(const Hit& hit, const Ray<T>& ray) const {
    const Shape& shape = shapes()[hit.shape];
    Interaction<T> at = driftlight::interact(shape.geometry, hit.primitive, ray, shape.textured);
    if (shape.anisotropic) at.tangent = tangent_field(shape.geometry, hit.primitive).at(at.p);
    if (shape.relief != nullptr)
      relieve(*shape.relief, std::get<TriangleMesh>(shape.geometry), hit.primitive, at);
    return at;
  }

  /// The BSDF that acts on the side of wi, or none for a black back side. On the back side of an
  /// opaque surface the normals of `at` are turned toward wi.
  template <Scalar T>
  const Bsdf* bsdf_at(const Hit& hit, const Vec3<T>& wi, Interaction<T>& at) const {
    const Material& material = materials()[shapes()[hit.shape].material];
    const Bsdf& front = bsdfs()[material.front];
    if (value(dot(at.n_g, wi)) > 0.0 || is_transmissive(front)) return &front;
    if (!material.back) return nullptr;
    at.n_g = -at.n_g;
    at.n_s = -at.n_s;
    return &bsdfs()[*material.back];
  }

  /// False if no emitter can be drawn from, as all are blurred.
  bool samples_emitters() const { return emitter_choice_.total() > 0.0; }
  /// Probability with which emitter sampling picks the emitter; 0 of blurred ones.
  double emitter_probability(std::uint32_t emitter) const {
    return emitter_choice_.probability(static_cast<int>(emitter));
  }
  std::uint32_t sample_emitter(double& u) const {
    return static_cast<std::uint32_t>(emitter_choice_.sample(u));
  }
  /// Uniform point on the shape of an area emitter, density 1 / area.
  EmitterPoint sample_area(const AreaEmitter& emitter, double u1, double u2) const;

  bool is_blurred(std::uint32_t emitter) const {
    return std::holds_alternative<BlurredAreaEmitter>(emitters_[emitter]);
  }
  /// The same shapes, which both share, under other emitters: each in the place of that of the
  /// same index, on the same shape or also at infinity.
  Scene with_emitters(std::vector<Emitter> emitters) const;
  /// The same shapes, which both share, with other BSDFs: each in the place of that of the same
  /// index, with the same lobes and textures.
  Scene with_bsdfs(std::vector<Bsdf> bsdfs) const;

 private:
  friend class SceneBuilder;
  struct Accelerator;
  struct Surfaces {
    std::vector<Shape> shapes;
    std::vector<Material> materials;
  };
  Scene();
  /// Shares the shapes.
  Scene(const Scene&);
  /// Embree's trees over the shapes, which must not move. Throws RuntimeError if it fails.
  static std::shared_ptr<const Accelerator> accelerate(const std::vector<Shape>& shapes);
  void choose_emitters_by_power();

  Camera camera_;
  std::shared_ptr<Surfaces> surfaces_;
  std::vector<Bsdf> bsdfs_;
  std::vector<Emitter> emitters_;
  std::optional<std::uint32_t> environment_;
  DiscreteDistribution emitter_choice_;
  Vec3d center_{0, 0, 0};
  double radius_ = 1;
  std::shared_ptr<const Accelerator> accelerator_;
};

/// Collects the parts of a scene. Indices are returned in order from 0.
class SceneBuilder {
 public:
  /// Throws InputError if it has more than kMaxLobes lobes.
  std::uint32_t add_bsdf(Bsdf bsdf);
  std::uint32_t add_material(const Material& material);
  /// With `radiance` the shape is an area emitter. Throws InputError on an empty mesh or one whose
  /// indices are out of range, and if the material has a relief that the shape cannot carry.
  std::uint32_t add_shape(Geometry geometry, std::uint32_t material,
                          std::optional<Rgbd> radiance = std::nullopt);
  /// Likewise where the radiance varies over the shape.
  std::uint32_t add_shape(Geometry geometry, std::uint32_t material, const Texture& radiance);
  void add_emitter(PointEmitter emitter);
  void add_emitter(SpotEmitter emitter);
  void add_emitter(DirectionalEmitter emitter);
  /// A ConstantEnvironment or EnvironmentMap. Throws InputError on a second one.
  void set_environment(Emitter environment);
  void set_camera(const Camera& camera);

  /// Throws InputError if there is no emitter or no light. The builder is empty afterwards.
  Scene build();

 private:
  Scene scene_;
};

}  // namespace driftlight
