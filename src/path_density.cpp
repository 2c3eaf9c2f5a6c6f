// SPDX-License-Identifier: Apache-2.0
#include "path_density.h"

#include <cmath>
#include <optional>

#include "driftlight/walk.h"

namespace driftlight {
namespace {

/// Density of the direction v by emission from a point or spot emitter.
double emission_density(const Emitter& light, const Vec3d& v) {
  if (const auto* spot = std::get_if<SpotEmitter>(&light))
    return spot->falloff(v) / spot->solid_angle();
  return 1.0 / std::get<PointEmitter>(light).solid_angle();
}

/// What the densities need of a scattering vertex x_k, k >= 1.
struct Vertex {
  Vec3d p;
  double forward;     ///< C_k
  double backward;    ///< l_k: density of the direction toward the sensor; of a delta lobe P
  double cosine_in;   ///< of the edge from the sensor's side
  double cosine_out;  ///< of v_k
  double etendue;     ///< of a delta lobe: n^2 cos d omega dA before it over that behind it
  double r2;          ///< squared length of the edge from x_{k-1}
  bool delta;
};

class Recorder : public WalkVisitor<double> {
 public:
  Recorder(const Scene& scene, const EmissionGuide& guide, const PathTopology& topology)
      : scene_(scene),
        guide_(guide),
        emitter_(topology.emitter),
        scatter_count_(topology.scatter_count),
        last_(scene.camera().origin),
        before_last_(last_) {}

  void sensor(const PerspectiveCamera& camera, const Vec3d& v) {
    importance = std::exp(camera.log_importance(v));
  }
  void position(const Shape&, const Vec3d& p) {
    r2 = (p - last_).squaredNorm();
    before_last_ = last_;
    last_ = p;
  }
  void scatter(const ScatterEvent<double>& e) {
    Vertex& x = add(e);
    x.delta = false;
    x.forward = pdf(e.bsdf, e.surface(), e.wi, e.wo);
    x.backward = pdf(e.bsdf, e.surface(), e.wo, e.wi);
    x.etendue = 1.0;
  }
  void connect(const ScatterEvent<double>& e) { scatter(e); }
  void delta(const ScatterEvent<double>& e) {
    Vertex& x = add(e);
    x.delta = true;
    x.forward = delta_probability(e.bsdf, e.surface(), e.wi, e.scattering);
    x.backward = delta_probability(e.bsdf, e.surface(), e.wo, e.scattering);
    const Vec3d& n_s = e.at.n_s;
    const Vec3d& n_g = e.at.n_g;
    x.etendue = std::abs(n_s.dot(e.wi) * n_g.dot(e.wo) / (n_s.dot(e.wo) * n_g.dot(e.wi)));
    if (e.scattering == Scattering::Transmission) {
      const double eta = delta_eta(e.bsdf);
      const double beyond = n_s.dot(e.wi) > 0.0 ? eta : 1.0 / eta;
      x.etendue /= beyond * beyond;
    }
  }
  void hit(const AreaEmitter& light, const double& cosine, const double& squared) {
    area_end(light, cosine, squared);
    guide_emission(last_, (before_last_ - last_) / std::sqrt(squared));
    measure = 1.0;
  }
  void area_connection(const AreaEmitter& light, const double& cosine, const double& squared) {
    area_end(light, cosine, squared);
    guide_emission(last_, (before_last_ - last_) / std::sqrt(squared));
    measure = cosine / squared;
  }
  void environment(const Emitter& light, const Vec3d& v) {
    const auto* map = std::get_if<EnvironmentMap>(&light);
    const double direction = map != nullptr ? map->pdf(v) : 0.25 * kInvPi;
    connected = direction;
    emitted = direction * kInvPi / (scene_.radius() * scene_.radius());
    guide_emission(last_, -v);
  }
  void point_connection(const Emitter& light, const Vec3d& wo, const double& squared) {
    connected = 1.0;
    emitted = emission_density(light, Vec3d(-wo)) / squared;
    guide_emission(position_of(light), -wo);
    can_hit = false;
  }
  void directional_connection(const DirectionalEmitter& light) { parallel_end(light, last_); }

  void vertex(int k) { index_ = static_cast<std::size_t>(k); }
  void light_scatter(const ScatterEvent<double>& e) {
    scatter(e);
    measure *= vertices[index_].cosine_in / vertices[index_].cosine_out;
  }
  void light_connect(const ScatterEvent<double>& e) { light_scatter(e); }
  void light_delta(const ScatterEvent<double>& e) {
    delta(e);
    measure /= vertices[index_].etendue;
  }
  void area_emission(const AreaEmitter& light, const Vec3d& normal, const Vec3d& v) {
    const double cosine = normal.dot(v);
    area_end(light, cosine, 1.0);
    guide_emission(last_, v);
    end_ = last_;
    measure = cosine;
  }
  void point_emission(const Emitter& light, const Vec3d& v) {
    emitted = emission_density(light, v);
    guide_emission(position_of(light), v);
    connected = 1.0;
    end_ = position_of(light);
    can_hit = false;
  }
  void directional_emission(const DirectionalEmitter& light, const Vec3d& offset) {
    parallel_end(light, scene_.center() + scene_.radius() * offset);
  }
  /// All vertices are known: their distances in order from the sensor.
  void joined(const double& squared) {
    measure /= squared;
    const Vec3d* from = &scene_.camera().origin;
    for (std::size_t k = 0; k < scatter_count_; ++k) {
      vertices[k].r2 = (vertices[k].p - *from).squaredNorm();
      from = &vertices[k].p;
    }
    if (!end_) return;
    const double end_r2 = (*end_ - *from).squaredNorm();
    if (can_hit) {
      connected *= end_r2;
    } else {
      emitted /= end_r2;
      measure *= end_r2;
    }
  }

  std::array<Vertex, kMaxPathLength> vertices;
  double importance = 1;  ///< C_0
  double r2 = 1;          ///< of the last edge to a surface
  double measure = 1;     ///< camera-side measure / (measure of the coordinates)
  double connected = 0;   ///< density of x_n by s = 1, per d omega_{n-1}
  double emitted = 0;     ///< density of x_n and of its direction, for s >= 2, as l_n / cos_n
  bool can_hit = true;

 private:
  Vertex& add(const ScatterEvent<double>& e) {
    Vertex& x = vertices[index_];
    x.p = e.at.p;
    x.cosine_in = std::abs(e.at.n_g.dot(e.wi));
    x.cosine_out = std::abs(e.at.n_g.dot(e.wo));
    x.r2 = r2;
    return x;
  }
  /// connected = r^2 / (A cos), emitted = (1 / A) (cos / pi) / cos
  void area_end(const AreaEmitter& light, double cosine, double squared) {
    const double per_area = 1.0 / scene_.shapes()[light.shape].extent.area;
    connected = per_area * squared / cosine;
    emitted = per_area * kInvPi;
  }
  void parallel_end(const DirectionalEmitter& light, const Vec3d& p) {
    connected = 1.0;
    emitted = kInvPi / (scene_.radius() * scene_.radius());
    guide_emission(p, light.direction);
    can_hit = false;
  }
  void guide_emission(const Vec3d& p, const Vec3d& v) { emitted *= guide_.factor(emitter_, p, v); }

  const Scene& scene_;
  const EmissionGuide& guide_;
  std::uint32_t emitter_;
  std::size_t scatter_count_;
  std::size_t index_ = 0;
  Vec3d last_, before_last_;  ///< of the positions visited
  std::optional<Vec3d> end_;  ///< the point that a light side begins at
};

}  // namespace

StrategyDensities strategy_densities(const Scene& scene, const EmissionGuide& guide,
                                     const PathTopology& topology,
                                     const PathCoordinates& coordinates) {
  Recorder path(scene, guide, topology);
  walk<double>(scene, topology, coordinates, path);
  const int n = topology.length();
  const auto vertex = [&](int k) -> const Vertex& {
    return path.vertices[static_cast<std::size_t>(k - 1)];
  };
  // prefix[t] = C_0 .. C_{t-2}: the camera part of t vertices.
  std::array<double, kMaxPathLength + 2> prefix;
  prefix[0] = prefix[1] = 1.0;
  for (int t = 2; t <= n + 1; ++t)
    prefix[static_cast<std::size_t>(t)] = prefix[static_cast<std::size_t>(t - 1)] *
                                          (t == 2 ? path.importance : vertex(t - 2).forward);

  StrategyDensities result;
  auto& q = result.by_light_vertices;
  if (path.can_hit) q[0] = path.measure * prefix[static_cast<std::size_t>(n) + 1];
  const double choice = scene.emitter_probability(topology.emitter) * path.measure;
  // Whether x_{t-1} can be connected to.
  const auto connects = [&](int t) { return t == 1 || !vertex(t - 1).delta; };
  if (connects(n)) q[1] = choice * path.connected * prefix[static_cast<std::size_t>(n)];
  // suffix: the light part down to x_t, with cos_t of the next chain still to come.
  double suffix = choice * path.emitted;
  for (int t = n - 1; t >= 1; --t) {
    const Vertex& x = vertex(t);
    if (x.delta) {
      const bool no_chart = topology.ends_at_delta_emitter() && !topology.has_light_side();
      if (no_chart && t == n - 1) return result;
      suffix *= x.backward * x.etendue;
      continue;
    }
    suffix *= x.cosine_out;
    if (connects(t))
      q[static_cast<std::size_t>(n + 1 - t)] =
          suffix * x.r2 / x.cosine_in * prefix[static_cast<std::size_t>(t)];
    suffix *= x.backward / x.cosine_in;
  }
  return result;
}

}  // namespace driftlight
