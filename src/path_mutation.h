// SPDX-License-Identifier: Apache-2.0
/// Mutations of a path by its vertices: E. Veach and L. Guibas, "Metropolis light transport",
/// SIGGRAPH 1997, and Veach's thesis, 1997, ch. 11.
///
/// - Bidirectional: of x the first a vertices and the last b are kept, the others are deleted, and
///   N new ones are put in their place, i of them from the sensor's side and N - i from the light's
///   by BSDF and emitter sampling, the two ends then joined by an edge. With b = 0 the last one is
///   a point drawn on an emitter, or for i = N one that a ray has hit. For given a and b the same y
///   can come of each i, so that with A_k and B_k of vertex_path.h
///     T(y | x) = p(a, b | n_x) p(N | a, b, N_x) 1 / (N + 1)
///                  sum_i prod_(a <= k < a + i) A_k(y)  prod_(a + i <= k <= n_y - b) B_k(y),
///   over those i whose joining edge has a delta vertex at neither end. The balance is detailed
///   for each pair (a, b) by itself.
/// - Lens: the film point moves; the ray follows the delta lobes of x up to the first vertex that
///   scatters otherwise, which is joined to the next one of x.
/// - Multi-chain: the same where that next vertex is a delta one. The direction toward it moves,
///   the ray follows the delta lobes, and so on up to a vertex that can be joined to the next one
///   of x, or to the emitter that a delta lobe leads to.
/// - Caustic: of E D S* (D|L) E, x_1 scatters other than by a delta lobe, and x_m is the first of
///   x_2, .. that does so, or the emitter. The direction at x_m toward the sensor moves (of light
///   from infinity its place across it), the ray follows the delta lobes of x to a new x_1, which
///   is joined to the sensor.
/// - Manifold (Jakob and Marschner 2012): x_b is any vertex that scatters otherwise than by a delta
///   lobe; x_a and x_c are the next ones on its two sides that are not held (manifold_walk.h), or
///   the path's ends; one at least is not its neighbour, or the others would do. The direction at
///   x_a toward x_b moves, the ray follows the held vertices to a new x_b, and those between it and
///   x_c, which stays, are found again.
/// Moves are isotropic, by a step whose density depends on its size alone; it cancels. What is left
/// of T(y | x) are the factors that turn film, solid angle and delta lobes into area,
///   lens, multi-chain   W(v_0) prod |n_g . wi|_k / r_k^2           over the new x_1 .. x_j
///   caustic             prod |n_g . wo|_k / r_(k+1)^2  prod J_k    over the new x_k, and the delta
///                                                                  ones among them but for x_m,
///   manifold            one of these over the new x_k up to x_b, at narrow lobes |dh / dwo| or
///                       |dh / dwi| in the place of 1 and J, and the density of manifold_walk.h.
/// These keep the lobes of x, and so may be told apart by them.
#pragma once

#include <array>
#include <optional>

#include "driftlight/phase_space.h"
#include "driftlight/random.h"
#include "driftlight/render.h"
#include "manifold_walk.h"
#include "vertex_path.h"

namespace driftlight {

/// What mutations may do.
struct MutationLimits {
  int min_edges = 1;
  int max_edges = kMaxPathLength;
  /// Sizes between which steps are drawn log-uniformly, in widths of the film.
  double step_min = 0;
  double step_max = 0;
  /// Share of the perturbations that are manifold perturbations.
  double manifold_probability = 0;
};

/// Vertices that a bidirectional mutation keeps: x_0 .. x_(sensor-1), and the last `light`.
struct KeptEnds {
  int sensor = 1;
  int light = 0;

  /// Those that it deletes of a path of so many edges.
  int deleted(int edges) const { return edges + 1 - sensor - light; }
};

/// x_a stays and the direction there moves, up to x_b, from which x_c is found again.
struct ManifoldSpan {
  int a = 0, b = 0, c = 0;
};
/// Those that a path has, with a < b < c; each may be taken from the other side too.
struct ManifoldSpans {
  int count = 0;
  std::array<ManifoldSpan, kMaxPathLength> all;
};
ManifoldSpans manifold_spans(const VertexPath& x);

/// log T(y | x) and log T(x | y), up to a common factor.
struct MutationDensities {
  double forward = 0;
  double reverse = 0;
};

/// The acceptance ratio pi(y) T(x | y) / (pi(x) T(y | x)), pi(x) positive, in the measure of
/// vertex_path.h. What is not finite, of y or of T, is counted and never accepted.
double acceptance_ratio(double log_pi_x, double log_pi_y, const MutationDensities& densities,
                        Rejections& rejections);

class PathMutation {
 public:
  PathMutation(const Scene& scene, const MutationLimits& limits);

  /// Each draws y and evaluates it. Other than Ok: there is none, or it carries no light.
  TraceStatus bidirectional(const VertexPath& x, VertexPath& y, MutationDensities& densities,
                            Rng& rng) const;
  /// The lens or multi-chain perturbation, one of which every path has; by steps of so many times
  /// the usual sizes.
  TraceStatus from_sensor(const VertexPath& x, VertexPath& y, MutationDensities& densities,
                          Rng& rng, double size = 1.0) const;
  /// The caustic perturbation, of a path that has it.
  TraceStatus caustic(const VertexPath& x, VertexPath& y, MutationDensities& densities, Rng& rng,
                      double size = 1.0) const;
  static bool has_caustic(const VertexPath& x);
  /// The manifold perturbation, of a path that has it.
  TraceStatus manifold(const VertexPath& x, VertexPath& y, MutationDensities& densities, Rng& rng,
                       double size = 1.0) const;
  static bool has_manifold(const VertexPath& x) { return manifold_spans(x).count > 0; }
  /// One of the perturbations of x, the manifold perturbation with the probability of the limits,
  /// the two others equally likely where it has both. They keep what this depends on, so each kind
  /// is in detailed balance by itself.
  TraceStatus perturb(const VertexPath& x, VertexPath& y, MutationDensities& densities, Rng& rng,
                      double size = 1.0) const;

  /// Draws y by a perturbation of so many times the usual size, and returns the acceptance ratio
  /// with pi = f; 0 if there is no y, which is counted.
  double propose(const VertexPath& x, VertexPath& y, double size, Rng& rng,
                 Rejections& rejections) const;

  // The parts of the bidirectional mutation.

  /// p(a, b | n)
  double probability(const KeptEnds& kept, int edges) const;
  KeptEnds draw_kept(int edges, Rng& rng) const;
  /// p(N | a, b, N_x), among those N that the limits allow.
  double probability(int count, const KeptEnds& kept, int deleted) const;
  int draw_count(const KeptEnds& kept, int deleted, Rng& rng) const;
  /// Makes y of the ends of x and new vertices from both sides. Not evaluated.
  TraceStatus regrow(const VertexPath& x, const KeptEnds& kept, int from_sensor, int from_light,
                     VertexPath& y, Rng& rng) const;
  /// log of the product above, of y that is evaluated; -infinity where i cannot make it.
  static double log_way(const VertexPath& y, const KeptEnds& kept, int from_sensor) {
    return y.log_product(kept.sensor, kept.sensor + from_sensor, y.edges - kept.light);
  }

 private:
  /// log T(y | x) for given ends, but for the factor p(a, b | n_x).
  double log_regrowth(const VertexPath& y, const KeptEnds& kept, int deleted) const;
  TraceStatus grow_from_sensor(VertexPath& y, int first, int count, bool hits, Rng& rng) const;
  TraceStatus grow_from_light(VertexPath& y, int last, int count, Rng& rng) const;
  /// The ray meets an emitter, which becomes the end of y.
  TraceStatus end_by_hit(VertexPath& y, RayFollower ray) const;
  TraceStatus joined(const VertexPath& y, int k) const;
  double draw_step(double size, Rng& rng) const;
  /// Of a direction that moves by such a step.
  double draw_angle(double size, Rng& rng) const;
  std::optional<Vec2d> moved_film(const VertexPath& x, double size, Rng& rng) const;
  RayFollower moved_from_light(const VertexPath& x, int m, double size, Rng& rng) const;
  /// The ray from x_a toward x_b, moved; none beside the film.
  std::optional<RayFollower> moved(const VertexPath& x, const ManifoldSpan& span, double size,
                                   Rng& rng) const;
  double log_manifold(const VertexPath& x, const ManifoldSpan& span) const;

  const Scene& scene_;
  MutationLimits limits_;
  ManifoldWalk walk_;
};

}  // namespace driftlight
