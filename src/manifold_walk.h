// SPDX-License-Identifier: Apache-2.0
/// Chains of vertices that keep their lobes while the ends of the chain move: W. Jakob and
/// S. Marschner, "Manifold exploration", SIGGRAPH 2012.
///
/// A vertex is held if it scatters by a delta lobe or by a narrow one: it keeps its half vector h,
/// in the frame of its shading normal, which for a delta lobe is the normal. Given x_p and x_q, the
/// held vertices between them are found by Newton's method on the direction at one of the two,
/// until the ray from there comes to the other.
///
/// Their density, in area, is that of h_k, which is left out as infinite factors are elsewhere
/// (vertex_path.h: of wo at delta lobes), times |det dh / dx| for given x_p and x_q. Let e_k be how
/// much wo at x_k is off what wi and h_k make of it. As (w_p, e_(p+1), .. e_(q-1)) makes
/// x_(p+1), .. x_q one after the other, and by Jacobi's formula for complementary minors of an
/// inverse,
///   |det de / dx| = prod_(p < k < q) |n_g . wi|_k / r_k^2  |dx_q / dw_p| / r_q^2,
/// dx_q across the last edge; at infinity a direction, and no r_q. For narrow lobes times |dh /
/// dwo|:
///   reflection 1 / (4 |wo . h|),   transmission eta^2 |wo . h| / (wi . h + eta wo . h)^2,
/// eta the index on the side of wo over that on the side of wi (Walter et al. 2007).
#pragma once

#include <array>
#include <optional>

#include "vertex_path.h"

namespace driftlight {

/// Largest roughness of a lobe that is held.
inline constexpr double kHeldRoughness = 0.1;

/// What a held vertex keeps.
struct HeldLobe {
  bool delta = false;
  Scattering scattering = Scattering::Reflection;
  Vec3d half{0, 0, 1};  ///< of a narrow lobe, in the frame of the shading normal
};

/// Whether the BSDF is one narrow lobe.
bool is_narrow(const Bsdf& bsdf);
inline bool is_held(const VertexPath::Vertex& x) { return x.delta || is_narrow(*x.surface.bsdf); }
/// Of the held vertex k of an evaluated path.
HeldLobe held_lobe(const VertexPath& path, int k);
/// log |dh / dwo| of that vertex, or |dh / dwi|; 0 at a delta lobe.
double log_narrowing(const VertexPath& path, int k, bool toward_light);

/// The ray meets vertex k of y, and what it meets scatters as that of x does.
TraceStatus arrive_as(const VertexPath& x, int k, RayFollower& ray, VertexPath& y);
/// The ray, which has come to this vertex, goes on by the lobe.
TraceStatus follow(const SurfaceHit& at, const HeldLobe& lobe, RayFollower& ray);

class ManifoldWalk {
 public:
  explicit ManifoldWalk(const Scene& scene) : scene_(scene) {}

  /// Follows the ray, which leaves x_from of y, through the held vertices of x strictly between the
  /// two. Either may be the larger one.
  TraceStatus follow_chain(const VertexPath& x, int from, int to, RayFollower& ray,
                           VertexPath& y) const;

  /// Finds those vertices for x_from, a surface, and x_to of y, which may be the sensor or the end.
  /// The last edge may be hidden. Missed: there are none, or they were not found.
  TraceStatus connect(const VertexPath& x, int from, int to, VertexPath& y) const;
  /// Whether connect, from y, finds the vertices of x: a proposal that has no way back must be
  /// refused. Both are evaluated.
  bool leads_back(const VertexPath& y, int from, int to, const VertexPath& x) const;

  /// log of the density of the vertices between p and q, p < q, of a path that is evaluated. 0 if
  /// there are none.
  double log_density(const VertexPath& path, int p, int q) const;

 private:
  using Lobes = std::array<HeldLobe, kMaxPathLength>;
  /// Where a ray passes x_to, in a plane across it, and the derivative by the direction at x_from.
  struct Passing {
    Vec2d miss{0, 0};
    Eigen::Matrix2d slope = Eigen::Matrix2d::Identity();
  };

  /// Of the ray along v through the vertices of y; none if x_to is behind it.
  std::optional<Passing> pass(const VertexPath& y, const Lobes& lobes, int from, int to,
                              const Vec3d& v) const;
  TraceStatus follow_lobes(const VertexPath& x, const Lobes& lobes, int from, int to,
                           RayFollower& ray, VertexPath& y) const;
  /// Newton's method, from the direction that x suggests.
  TraceStatus solve(const VertexPath& x, const Lobes& lobes, int from, int to, VertexPath& y) const;
  static Lobes lobes_between(const VertexPath& x, int from, int to);

  const Scene& scene_;
};

}  // namespace driftlight
