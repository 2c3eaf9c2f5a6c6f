// SPDX-License-Identifier: Apache-2.0
/// The densities of path_density.h for every Scalar.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "bsdf_warp.h"
#include "driftlight/walk.h"
#include "emission_guide.h"

namespace driftlight {

/// Density of the direction v by emission from a point or spot emitter.
template <Scalar T>
T point_emission_density(const Emitter& light, const Vec3<T>& v) {
  if (const auto* spot = std::get_if<SpotEmitter>(&light))
    return spot->falloff(v) / spot->solid_angle();
  return constant<T>(1.0 / std::get<PointEmitter>(light).solid_angle());
}

template <Scalar T>
T squared_distance(const Vec3<T>& a, const Vec3<T>& b) {
  const Vec3<T> edge = a - b;
  return dot(edge, edge);
}

/// What the densities need of a scattering vertex x_k, k >= 1.
template <Scalar T>
struct DensityVertex {
  Vec3<T> p;
  T forward;     ///< C_k
  T backward;    ///< l_k: density of the direction toward the sensor; of a delta lobe P
  T cosine_in;   ///< of the edge from the sensor's side
  T cosine_out;  ///< of v_k
  T etendue;     ///< of a delta lobe: n^2 cos d omega dA before it over that behind it
  T r2;          ///< squared length of the edge from x_{k-1}; of x_1 Camera::spread
  bool delta;
};

/// Takes down what the densities need of a path.
template <Scalar T>
class DensityVisitor : public WalkVisitor<T> {
 public:
  using Vertex = DensityVertex<T>;

  DensityVisitor(const Scene& scene, const EmissionGuide& guide, const PathTopology& topology)
      : scene_(scene),
        guide_(guide),
        emitter_(topology.emitter),
        scatter_count_(topology.scatter_count),
        lens_(constant<T>(scene.camera().origin)),
        last_(lens_),
        before_last_(last_),
        v0_(last_) {}

  void lens(const Camera& camera, const Vec3<T>& p) {
    lens_density = camera.lens_density();
    last_ = p;
  }
  void sensor(const Camera& camera, const Vec3<T>& v, const Vec3<T>& lens) {
    using std::exp;
    importance = exp(camera.log_importance(v));
    v0_ = v;
    lens_ = lens;
    at_sensor_ = true;
  }
  void depart_parallel(Ray<T>& ray) { last_ = ray.origin; }
  void position(const Shape&, const Vec3<T>& p) {
    r2 = at_sensor_ ? scene_.camera().spread(v0_, p, lens_) : squared_distance(p, last_);
    at_sensor_ = false;
    before_last_ = last_;
    last_ = p;
  }
  void scatter(const ScatterEvent<T>& e) {
    Vertex& x = add(e);
    x.delta = false;
    x.forward = pdf_of<T>(e.bsdf, e.surface(), e.wi, e.wo);
    x.backward = pdf_of<T>(e.bsdf, e.surface(), e.wo, e.wi);
    x.etendue = constant<T>(1.0);
  }
  void connect(const ScatterEvent<T>& e) { scatter(e); }
  void delta(const ScatterEvent<T>& e) {
    using std::abs;
    Vertex& x = add(e);
    x.delta = true;
    x.forward = delta_probability_of<T>(e.bsdf, e.surface(), e.wi, e.scattering);
    x.backward = delta_probability_of<T>(e.bsdf, e.surface(), e.wo, e.scattering);
    const Vec3<T>& n_s = e.at.n_s;
    const Vec3<T>& n_g = e.at.n_g;
    x.etendue = abs(dot(n_s, e.wi) * dot(n_g, e.wo) / (dot(n_s, e.wo) * dot(n_g, e.wi)));
    if (e.scattering == Scattering::Transmission) {
      const double eta = delta_eta(e.bsdf);
      const double beyond = value(dot(n_s, e.wi)) > 0.0 ? eta : 1.0 / eta;
      x.etendue = x.etendue / (beyond * beyond);
    }
  }
  void hit(const AreaEmitter& light, const T& cosine, const T& squared) {
    using std::sqrt;
    area_end(light, cosine, r2);
    guide_emission(last_, Vec3<T>((before_last_ - last_) / sqrt(squared)));
    measure = constant<T>(1.0);
  }
  void area_connection(const AreaEmitter& light, const T& cosine, const T& squared) {
    using std::sqrt;
    area_end(light, cosine, squared);
    guide_emission(last_, Vec3<T>((before_last_ - last_) / sqrt(squared)));
    measure = cosine / squared;
  }
  void environment(const Emitter& light, const Vec3<T>& v) {
    const auto* map = std::get_if<EnvironmentMap>(&light);
    // Constant within a patch of the map.
    const double direction = map != nullptr ? map->pdf(value(v)) : 0.25 * kInvPi;
    // No ray of an orthographic sensor comes to a direction that was drawn.
    const bool parallel = scatter_count_ == 0 && scene_.camera().is_orthographic();
    connected = constant<T>(parallel ? 0.0 : direction);
    emitted = constant<T>(direction * kInvPi / (scene_.radius() * scene_.radius()));
    guide_emission(last_, Vec3<T>(-v));
  }
  void point_connection(const Emitter& light, const Vec3<T>& wo, const T& squared) {
    connected = constant<T>(1.0);
    emitted = point_emission_density(light, Vec3<T>(-wo)) / squared;
    guide_emission(constant<T>(position_of(light)), Vec3<T>(-wo));
    can_hit = false;
  }
  void directional_connection(const DirectionalEmitter& light) { parallel_end(light, last_); }

  void vertex(int k) { index_ = static_cast<std::size_t>(k); }
  void light_scatter(const ScatterEvent<T>& e) {
    scatter(e);
    measure *= vertices[index_].cosine_in / vertices[index_].cosine_out;
  }
  void light_connect(const ScatterEvent<T>& e) { light_scatter(e); }
  void light_delta(const ScatterEvent<T>& e) {
    delta(e);
    measure /= vertices[index_].etendue;
  }
  void area_emission(const AreaEmitter& light, const Vec3<T>& normal, const Vec3<T>& v) {
    const T cosine = dot(normal, v);
    area_end(light, cosine, constant<T>(1.0));
    guide_emission(last_, v);
    end_ = last_;
    measure = cosine;
  }
  void point_emission(const Emitter& light, const Vec3<T>& v) {
    emitted = point_emission_density(light, v);
    guide_emission(constant<T>(position_of(light)), v);
    connected = constant<T>(1.0);
    end_ = constant<T>(position_of(light));
    can_hit = false;
  }
  void directional_emission(const DirectionalEmitter& light, const Vec3<T>& offset) {
    parallel_end(light, constant<T>(scene_.center()) + constant<T>(scene_.radius()) * offset);
  }
  void environment_emission(const Emitter& light, const Vec3<T>& offset, const Vec3<T>& v) {
    last_ = constant<T>(scene_.center()) + constant<T>(scene_.radius()) * offset;
    environment(light, Vec3<T>(-v));
  }
  /// All vertices are known: their distances in order from the sensor.
  void joined(const T& squared) {
    measure /= squared;
    vertices[0].r2 = scene_.camera().spread(v0_, vertices[0].p, lens_);
    const Vec3<T>* from = &vertices[0].p;
    for (std::size_t k = 1; k < scatter_count_; ++k) {
      vertices[k].r2 = squared_distance(vertices[k].p, *from);
      from = &vertices[k].p;
    }
    if (!end_) return;
    const T end_r2 = squared_distance(*end_, *from);
    if (can_hit) {
      connected *= end_r2;
    } else {
      emitted /= end_r2;
      measure *= end_r2;
    }
  }

  std::array<Vertex, kMaxPathLength> vertices;
  double lens_density = 1;          ///< of the point on the lens, which all strategies draw
  T importance = constant<T>(1.0);  ///< C_0
  T r2 = constant<T>(1.0);          ///< of the last edge to a surface
  T measure = constant<T>(1.0);     ///< camera-side measure / (measure of the coordinates)
  T connected = constant<T>(0.0);   ///< density of x_n by s = 1, per d omega_{n-1}
  T emitted =
      constant<T>(0.0);  ///< density of x_n and of its direction, for s >= 2, as l_n / cos_n
  bool can_hit = true;

 private:
  Vertex& add(const ScatterEvent<T>& e) {
    using std::abs;
    Vertex& x = vertices[index_];
    x.p = e.at.p;
    x.cosine_in = abs(dot(e.at.n_g, e.wi));
    x.cosine_out = abs(dot(e.at.n_g, e.wo));
    x.r2 = r2;
    return x;
  }
  /// connected = r^2 / (A cos), emitted = (1 / A) (cos / pi) / cos
  void area_end(const AreaEmitter& light, const T& cosine, const T& squared) {
    const double per_area = 1.0 / scene_.shapes()[light.shape].extent.area;
    connected = per_area * squared / cosine;
    emitted = constant<T>(per_area * kInvPi);
  }
  void parallel_end(const DirectionalEmitter& light, const Vec3<T>& p) {
    connected = constant<T>(1.0);
    emitted = constant<T>(kInvPi / (scene_.radius() * scene_.radius()));
    guide_emission(p, constant<T>(light.direction));
    can_hit = false;
  }
  /// The guide's factor is piecewise constant.
  void guide_emission(const Vec3<T>& p, const Vec3<T>& v) {
    emitted = emitted * guide_.factor(emitter_, value(p), value(v));
  }

  const Scene& scene_;
  const EmissionGuide& guide_;
  std::uint32_t emitter_;
  std::size_t scatter_count_;
  std::size_t index_ = 0;
  Vec3<T> lens_;                ///< where the first ray begins
  Vec3<T> last_, before_last_;  ///< of the positions visited
  Vec3<T> v0_;                  ///< coordinate of the first ray
  bool at_sensor_ = false;      ///< the next position is that of x_1
  std::optional<Vec3<T>> end_;  ///< the point that a light side begins at
};

/// q_s of the path that was taken down, for every s = 0 .. n; 0 where a strategy cannot make it.
template <Scalar T>
std::array<T, kMaxPathLength + 1> densities_by_light_vertices(const DensityVisitor<T>& path,
                                                              const PathTopology& topology,
                                                              double choice_probability) {
  const int n = topology.length();
  const auto vertex = [&](int k) -> const DensityVertex<T>& {
    return path.vertices[static_cast<std::size_t>(k - 1)];
  };
  // prefix[t] = C_0 .. C_{t-2}: the camera part of t vertices.
  std::array<T, kMaxPathLength + 2> prefix;
  prefix[0] = prefix[1] = constant<T>(path.lens_density);
  for (int t = 2; t <= n + 1; ++t)
    prefix[static_cast<std::size_t>(t)] = prefix[static_cast<std::size_t>(t - 1)] *
                                          (t == 2 ? path.importance : vertex(t - 2).forward);

  std::array<T, kMaxPathLength + 1> q;
  q.fill(constant<T>(0.0));
  if (path.can_hit) q[0] = path.measure * prefix[static_cast<std::size_t>(n) + 1];
  const T choice = choice_probability * path.measure;
  // Whether x_{t-1} can be connected to.
  const auto connects = [&](int t) { return t == 1 || !vertex(t - 1).delta; };
  if (connects(n)) q[1] = choice * path.connected * prefix[static_cast<std::size_t>(n)];
  // suffix: the light part down to x_t, with cos_t of the next chain still to come.
  T suffix = choice * path.emitted;
  for (int t = n - 1; t >= 1; --t) {
    const DensityVertex<T>& x = vertex(t);
    if (x.delta) {
      const bool no_chart = topology.ends_at_delta_emitter() && !topology.has_light_side();
      if (no_chart && t == n - 1) return q;
      suffix *= x.backward * x.etendue;
      continue;
    }
    suffix *= x.cosine_out;
    if (connects(t))
      q[static_cast<std::size_t>(n + 1 - t)] =
          suffix * x.r2 / x.cosine_in * prefix[static_cast<std::size_t>(t)];
    suffix *= x.backward / x.cosine_in;
  }
  return q;
}

}  // namespace driftlight
