// SPDX-License-Identifier: Apache-2.0
/// Subpaths from the sensor and from the light, and how much of a path each strategy gets. The
/// sensor's lens is what one point of it makes of it: all strategies draw that point alike.
///
/// A path x_0 .. x_n runs from the sensor to the light. Strategy (s, t), s + t = n + 1, walks to
/// x_0 .. x_(t-1) from the sensor and to x_n .. x_t from the light, and joins the two by the edge
/// between. (0, t) hits the emitter, (1, t) connects to a point drawn on it, (s, 1) connects to the
/// sensor. An edge with a delta vertex at either end cannot be a connection.
///
/// Densities of vertices are per area, p(omega) |n_g . omega| / r^2. A delta lobe is a density like
/// any other, a narrow one: its infinite factor is the same for all strategies, and what remains of
/// it is P toward the light, the probability of the lobe, and P J toward the sensor,
///   J = d omega_o / d omega_i = n_i^2 |n_s . wi| / (n_o^2 |n_s . wo|)
/// with n the refractive indices on the two sides: n^2 |cos| d omega is conserved (etendue).
///
/// Weights (Veach 1997, 9.2 and 10.2), with b = 1 for the balance and 2 for the power heuristic;
/// both are found together. On its own side a strategy that ends in x_k knows those that leave x_k,
/// or x_k and x_(k-1), .. to the other side; their densities over its own, to the b, add up to
///   S_k = (d_k / p_k)^b (S_(k-1) + c_k),
/// p_k the density of x_k by this walk, d_k that by the other one, and c_k = 1 if the edge from
/// x_(k-1) to x_k can be a connection, else 0. The weight of the strategy is 1 / (1 + S + S') with
/// the sums of both of its sides. Since d_(k-1) = q_k g_k, with q_k the density of the direction
/// from x_k back to x_(k-1), which depends on where the path goes on from x_k, and g_k = cos / r^2
/// at x_(k-1), which does not, a vertex stores
///   others_k = (g_k / p_(k-1))^b (S_(k-2) + c_(k-1)),   so that S_(k-1) = q_k^b others_k,
/// and no sum ever runs over a subpath again.
#pragma once

#include <array>
#include <optional>

#include "emission_guide.h"

namespace driftlight {

/// Which end of the path a subpath starts from.
enum class Walk : std::uint8_t { FromSensor, FromLight };

/// What there is of both heuristics: of the balance heuristic first, then of the power heuristic.
using OfHeuristics = Eigen::Array2d;
/// x^b
inline OfHeuristics powers(double x) { return {x, x * x}; }

/// What the weights know of a vertex that a walk has come to.
struct Arrival {
  double density = 0;              ///< p_k per area; at infinity per solid angle
  OfHeuristics others{0, 0};       ///< see above
  bool previous_connects = false;  ///< x_(k-1) has not scattered by a delta lobe
};

/// A surface vertex. `surface.wi` points to the previous vertex of the same subpath.
struct SubpathVertex : Arrival {
  SurfaceHit surface{};
  /// What multiplies the factors of the path from here on: of a subpath from the sensor radiance,
  /// of one from the light power.
  Rgbd throughput{0, 0, 0};
  double roulette = 1;    ///< factor of the throughput that makes up for roulette
  bool connects = false;  ///< not all lobes are delta ones
  bool delta = false;     ///< the lobe by which the subpath has left
};

/// A subpath on its way between two vertices.
struct Departure {
  Vec3d p{0, 0, 0};          ///< where it comes from
  Vec3d direction{0, 0, 0};  ///< unit
  /// One of parallel rays: from an emitter at infinity, where p has no meaning, or an orthographic
  /// sensor.
  bool parallel = false;
  double cosine = 1;   ///< |n_g . omega| there; 1 at the sensor, at points and at infinity
  double density = 0;  ///< of the ray, per solid angle; of parallel ones per area across them
  Rgbd throughput{0, 0, 0};
  double roulette = 1;        ///< as of a vertex
  OfHeuristics others{0, 0};  ///< of the next vertex, without its g^b
  bool connects = false;
};

/// Surface vertices in order from the start, which is not among them.
class Subpath {
 public:
  int size() const { return size_; }
  const SubpathVertex& operator[](int i) const { return vertices_[static_cast<std::size_t>(i)]; }
  void clear() { size_ = 0; }
  SubpathVertex& add(const SubpathVertex& vertex) {
    return vertices_[static_cast<std::size_t>(size_++)] = vertex;
  }

 private:
  std::array<SubpathVertex, kMaxPathLength> vertices_;
  int size_ = 0;
};

/// Whether dim subpaths end early, at random.
enum class Roulette { Off, On };

class SubpathTracer {
 public:
  /// Walks from the light begin as the guide says, which must outlive it.
  SubpathTracer(const Scene& scene, const EmissionGuide& guide, Roulette roulette = Roulette::On)
      : scene_(scene), guide_(guide), roulette_(roulette) {}

  /// Leaves the sensor at this point of its lens, by the ray of the coordinate v. Its throughput
  /// makes the path an estimate of the radiance there.
  Departure leave_sensor(const Vec3d& v, const Vec3d& lens) const;
  /// Leaves the light along a ray.
  Departure leave_light(const Emission& emission) const;
  /// Comes to a surface.
  SubpathVertex arrive(const Departure& from, const SurfaceHit& surface) const;
  /// Leaves the scene.
  Arrival arrive_at_infinity(const Departure& from) const;
  /// Leaves a surface along `next`, drawn with `scattering` by the BSDF.
  Departure depart(Walk walk, const SubpathVertex& x, const BsdfSample& next) const;

  /// Walks on by BSDF sampling, and Russian roulette if that is on, until the subpath has
  /// `max_size` vertices or ends. The departure that left the scene, if one did.
  std::optional<Departure> trace(Walk walk, const Departure& start, RayFollower follower,
                                 int max_size, Rng& rng, Subpath& subpath) const;

 private:
  const Scene& scene_;
  const EmissionGuide& guide_;
  Roulette roulette_;
};

/// f_s |n_s . wo| with wi toward the sensor and wo toward the light, as a colour; of densities.
Rgbd scattered(const SurfaceHit& x, const Vec3d& wi, const Vec3d& wo);

/// A scattering event: its factor of the path contribution, and its densities per solid angle by
/// both walks; by a delta lobe what remains of these, P toward the light and P J toward the sensor.
struct ScatteringDensities {
  Rgbd f;
  double toward_light;
  double toward_sensor;
};
/// By the BSDF's density, and by its delta lobe of this kind.
ScatteringDensities density_event(const SurfaceHit& x, const Vec3d& wi, const Vec3d& wo);
ScatteringDensities delta_event(const SurfaceHit& x, const Vec3d& wi, const Vec3d& wo,
                                Scattering scattering);

}  // namespace driftlight
