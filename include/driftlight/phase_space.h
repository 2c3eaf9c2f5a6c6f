// SPDX-License-Identifier: Apache-2.0
/// The phase space of directions ([E63] section 2, DESIGN 1.2): tracing, charts, retraction.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "driftlight/path.h"
#include "driftlight/scene.h"

namespace driftlight {

/// Vectors and matrices over the coordinates of a path; never allocate.
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDimension, 1>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaxDimension,
                             kMaxDimension>;

/// The point on the lens that a path begins at; the origin of a camera without one.
inline const Vec3d& lens_point(const Scene& scene, const PathTopology& topology,
                               const PathCoordinates& coordinates) {
  return topology.has_lens ? coordinates(0) : scene.camera().origin;
}

/// What became of a trace.
enum class TraceStatus : std::uint8_t {
  Ok,
  Missed,     ///< left the film or the scene, or ended on nothing that emits
  OtherLobe,  ///< met a surface that scatters in another way (delta or not, through or back)
  Occluded,   ///< the connection, or the way to the environment, is blocked
};

/// True if points on an area emitter of this shape can be coordinates: planar ones, unless their
/// texture is bent, and spheres.
bool has_points(const Shape& emitter);

/// True if a path whose last scattering vertex has this lobe reaches the area emitter through a
/// connection; else its last direction is free to hit it. A function of the lobe and the emitter
/// only, so that each path has exactly one chart: diffuse lobes, which care little about direction,
/// connect; and only to emitters that have points.
bool connects_to_area(Lobe last, const Shape& emitter);

/// True if the BSDF has the lobe by which the vertex goes on.
bool has_lobe(const Bsdf& bsdf, const PathVertex& vertex);

/// Radiance may pass from wo to wi: both lie on the same side of the geometric and of the shading
/// normal (Veach's remedy for light leaks through interpolated normals).
bool passes(const Interaction<double>& at, const Vec3d& wi, const Vec3d& wo);

/// Traces `coordinates` with the delta choices and the end of `pattern`, the topology of a nearby
/// path, and writes the new topology. This is the only discrete walk of a small step. On failure
/// `result` is unspecified.
TraceStatus trace(const Scene& scene, const PathTopology& pattern,
                  const PathCoordinates& coordinates, PathTopology& result);

/// Tangent coordinates delta about a point of the phase space: for each block an orthogonal basis
/// of the tangent plane, of unit length for directions and of the length of the emitter's radius
/// for emitter points, so that a unit step is of the size of the emitter; likewise for points on a
/// lens.
class Chart {
 public:
  /// A plane or a sphere that a block lives on.
  struct Block {
    Vec3d t, b;         ///< tangents
    Vec3d normal;       ///< unit; for sphere blocks the position is center + radius * normal
    double length = 1;  ///< of t and b
    double radius = 1;  ///< of the sphere; 0: a plane
    Vec3d point;        ///< the base point itself
  };

  Chart() = default;
  Chart(const Scene& scene, const PathTopology& topology, const PathCoordinates& coordinates);

  int block_count() const { return count_; }
  int dimension() const { return 2 * count_; }
  const Block& block(int k) const { return blocks_[static_cast<std::size_t>(k)]; }
  /// The same chart with block k's tangents turned by `angle`; nothing may depend on it.
  void rotate(int k, double angle);

  /// Block k at tangent coordinates (d0, d1), the projection (E63.5) back onto the manifold:
  /// c + R normalize(R n + t d0 + b d1) on a sphere, y + t d0 + b d1 on a plane.
  template <Scalar T>
  Vec3<T> retract(int k, const T& d0, const T& d1) const {
    const Block& block = this->block(k);
    const Vec3<T> step = {d0 * block.t.x() + d1 * block.b.x(), d0 * block.t.y() + d1 * block.b.y(),
                          d0 * block.t.z() + d1 * block.b.z()};
    if (block.radius == 0.0) return constant<T>(block.point) + step;
    const Vec3<T> n = normalized(Vec3<T>(constant<T>(Vec3d(block.radius * block.normal)) + step));
    const Vec3d center = block.point - block.radius * block.normal;
    return along(constant<T>(center), constant<T>(block.radius), n);
  }

  PathCoordinates retract(const Vector& delta) const;

  /// The point at `delta` with d retract / d delta there as its tangents, which are not orthogonal
  /// any more: for derivatives over the coordinates of this chart, not for steps.
  Chart displaced(const Vector& delta) const;

  /// delta with retract(delta) = `to`, and log |d delta / d X| there, in the measure of the phase
  /// space: sum of -3 log cos over sphere blocks (gnomonic projection), DESIGN 1.4. None if a block
  /// lies beyond the horizon of its tangent plane.
  struct Inverse {
    Vector delta;
    double log_jacobian;
  };
  std::optional<Inverse> inverse(const PathCoordinates& to) const;

 private:
  std::array<Block, kMaxBlocks> blocks_;
  int count_ = 0;
};

}  // namespace driftlight
