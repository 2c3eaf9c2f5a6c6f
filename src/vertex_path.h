// SPDX-License-Identifier: Apache-2.0
/// A path by its vertices, in the measure of area, for the mutations of path_mutation.h.
///
/// Of x_0 .. x_n, the sensor to the light, the density of f is taken per area of x_1 .. x_n, per
/// solid angle of an x_n that is the direction of an environment, and by count of the one point of
/// a delta emitter. Delta lobes are densities like any other, narrow ones, as in subpath.h: their
/// infinite factors are alike in f and in each density that can make the path, and left out of
/// both. With wi and wo toward the sensor and the light at each vertex,
///   f = W(v_0) prod_(0 < k < n) { f_s |n_s . wo|_k  |n_g . wi|_k / r_k^2 }  L cos_n / r_n^2,
/// r_k the length of the edge from x_(k-1); no cosine at a delta emitter, neither it nor r_n at
/// infinity. The sensor is a pinhole. From the sensor and from the light x_k has the densities
///   A_k = p_(k-1)(wo) |n_g . wi|_k / r_k^2,   B_k = p_(k+1)(wi) |n_g . wo|_k / r_(k+1)^2,
/// p_0 = W(v_0), p_n that of emission, and B_n that of emitter sampling.
#pragma once

#include <array>
#include <string>

#include "bidirectional_tracer.h"
#include "driftlight/contribution.h"
#include "driftlight/path_sampler.h"

namespace driftlight {

/// log of a sum of at most kMaxPathLength + 2 terms, given by their logs.
class LogSum {
 public:
  void add(double log_term) { terms_[count_++] = log_term; }
  /// -infinity of none.
  double value() const;

 private:
  std::array<double, kMaxPathLength + 2> terms_{};
  std::size_t count_ = 0;
};

class VertexPath {
 public:
  /// x_k, 0 < k < n. Its directions are those to its neighbours, not `surface.wi`.
  struct Vertex {
    SurfaceHit surface{};
    bool delta = false;                              ///< it scatters by a delta lobe
    Scattering scattering = Scattering::Reflection;  ///< that of the delta lobe

    /// As the lobe that it goes on by.
    PathVertex lobe() const { return {surface.hit, delta, scattering}; }
  };

  int edges = 0;  ///< n
  LightEnd end;   ///< x_n
  Vertex& operator()(int k) { return vertices_[static_cast<std::size_t>(k - 1)]; }
  const Vertex& operator()(int k) const { return vertices_[static_cast<std::size_t>(k - 1)]; }

  /// Copies x_first .. x_last of another path, so many places further on.
  void take(const VertexPath& x, int first, int last, int shift = 0) {
    for (int k = first; k <= last; ++k) (*this)(k + shift) = x(k);
  }
  /// x_k, 0 <= k <= n; the direction of an end at infinity.
  const Vec3d& position(const Scene& scene, int k) const {
    if (k == edges) return end.p;
    return k == 0 ? scene.camera().origin : (*this)(k).surface.at.p;
  }

  /// Takes down all that follows from the vertices; to be called when they have changed. False if
  /// the path carries no light. Whether its edges are free is not its concern.
  bool evaluate(const Scene& scene);

  /// The rest is of a path that carries light.

  const Contribution& contribution() const { return contribution_; }
  /// Unit direction from x_k to x_(k+1).
  const Vec3d& toward_light(int k) const { return directions_[static_cast<std::size_t>(k)]; }
  /// log A_k, 0 < k <= n; -infinity of an end that no ray can find.
  double log_from_sensor(int k) const { return at(forward_, k - 1) + at(arriving_, k); }
  /// log B_k, 0 < k <= n.
  double log_from_light(int k) const {
    return k == edges ? log_end_ : at(backward_, k + 1) + at(leaving_, k);
  }
  /// log of |n_g . wi|_k / r_k^2 and of |n_g . wo|_k / r_(k+1)^2
  double log_arriving(int k) const { return at(arriving_, k); }
  double log_leaving(int k) const { return at(leaving_, k); }
  /// log J of the delta vertex k: its density toward the sensor, over P.
  double log_spread(int k) const { return at(backward_, k) - at(forward_, k); }
  /// log W(v_0)
  double log_importance() const { return at(forward_, 0); }
  /// log of prod_(first <= k < joint) A_k prod_(joint <= k <= last) B_k: the vertices before the
  /// joint are made from the sensor, the others from the light; with joint = n + 1 all from the
  /// sensor. -infinity where the joining edge cannot be a connection.
  double log_product(int first, int joint, int last) const;
  /// Whether an edge from x_(k-1) to x_k may be a connection.
  bool connects(int k) const {
    return (k == 1 || !(*this)(k - 1).delta) && (k == edges || !(*this)(k).delta) && edges > 1;
  }

 private:
  using Logs = std::array<double, kMaxPathLength + 1>;
  static double at(const Logs& logs, int k) { return logs[static_cast<std::size_t>(k)]; }

  std::array<Vertex, kMaxPathLength> vertices_;
  Contribution contribution_;
  std::array<Vec3d, kMaxPathLength> directions_;
  Logs forward_{};   ///< log p_k(wo)
  Logs backward_{};  ///< log p_k(wi)
  Logs arriving_{};
  Logs leaving_{};
  double log_end_ = 0;
};

/// log q, the density with which one bidirectional sample by this guide finds an evaluated path:
/// q = sum_s prod_(k <= n - s) A_k prod_(k > n - s) B_k over the strategies of s vertices from the
/// light whose joining edge has a delta vertex at neither end, for s > 1 times the guide's factor.
/// Emitters that are seen directly are left to s = 0.
double log_density(const VertexPath& path, const EmissionGuide& guide);

bool is_pinhole(const Camera& camera);

/// Throws InputError unless the scene's sensor is a pinhole; it begins with `who`, which needs one.
void require_pinhole(const Scene& scene, const std::string& who);

/// The same paths by their vertices, not yet evaluated.
VertexPath vertex_path(const Scene& scene, const PathTopology& topology,
                       const PathCoordinates& coordinates);
VertexPath vertex_path(const Scene& scene, const PathSampler::Sample& sample);
VertexPath vertex_path(const FoundPath& found);

}  // namespace driftlight
