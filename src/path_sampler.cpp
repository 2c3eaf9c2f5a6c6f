// SPDX-License-Identifier: Apache-2.0
#include "driftlight/path_sampler.h"

#include <cmath>
#include <limits>

#include "ray_follower.h"

namespace driftlight {
namespace {

/// Table entries: length 1 by hit only, then (2, hit), (2, connect), (3, hit), ..
int entry_of(int length, EndStrategy strategy) {
  return length == 1 ? 0 : 2 * length - 3 + (strategy == EndStrategy::Connect ? 1 : 0);
}
int length_of(int entry) { return (entry + 3) / 2; }
EndStrategy strategy_of(int entry) {
  return entry > 0 && entry % 2 == 0 ? EndStrategy::Connect : EndStrategy::Hit;
}

/// Accumulates the density; the factor of the last scattering waits until the end is known.
class DensityVisitor : public WalkVisitor<double> {
 public:
  DensityVisitor(const Scene& scene, std::uint32_t emitter, double hit, double connect)
      : scene_(scene), emitter_(emitter), hit_(hit), connect_(connect) {}

  void sensor(const PerspectiveCamera& camera, const Vec3d& v) {
    log_density_ = camera.log_importance(v);
  }
  void scatter(const ScatterEvent<double>& e) { next(pdf(e.bsdf, e.surface(), e.wi, e.wo), false); }
  void connect(const ScatterEvent<double>& e) { scatter(e); }
  void delta(const ScatterEvent<double>& e) {
    next(delta_probability(e.bsdf, e.surface(), e.wi, e.scattering), true);
  }
  void hit(const AreaEmitter& light, const double& cosine, const double& r2) {
    end(area_pdf(light) * r2 / cosine);
  }
  void environment(const Emitter& light, const Vec3d& v) {
    const auto* map = std::get_if<EnvironmentMap>(&light);
    end(scene_.emitter_probability(emitter_) * (map != nullptr ? map->pdf(v) : 0.25 * kInvPi));
  }
  void area_connection(const AreaEmitter& light, const double& cosine, const double& r2) {
    last_pdf_ *= cosine / r2;  // of hitting y, per area
    end(area_pdf(light));
  }
  void point_connection(const PointEmitter&, const double&) {
    last_pdf_ = 0.0;
    end(scene_.emitter_probability(emitter_));
  }

  double log_density() const { return log_density_; }

 private:
  void next(double pdf, bool is_delta) {
    log_density_ += std::log(last_pdf_);
    last_pdf_ = pdf;
    can_connect_ = !is_delta;
  }
  double area_pdf(const AreaEmitter& light) const {
    return scene_.emitter_probability(emitter_) / scene_.shapes()[light.shape].extent.area;
  }
  void end(double emitter_pdf) {
    log_density_ += std::log(hit_ * last_pdf_ + (can_connect_ ? connect_ * emitter_pdf : 0.0));
  }

  const Scene& scene_;
  std::uint32_t emitter_;
  double hit_;
  double connect_;
  double log_density_ = 0;
  double last_pdf_ = 1;
  bool can_connect_ = false;
};

}  // namespace

PathSampler::PathSampler(const Scene& scene, int max_depth)
    : scene_(scene),
      max_depth_(max_depth),
      table_(std::vector<double>(static_cast<std::size_t>(2 * max_depth - 1), 1.0)) {}

void PathSampler::learn(const std::vector<RunningMean>& weights) {
  double energy = 0;
  double spread = 0;
  for (const RunningMean& w : weights) {
    energy += w.sum;
    spread += std::sqrt(w.sum_of_squares);
  }
  if (!(energy > 0.0)) return;
  std::vector<double> probabilities;
  probabilities.reserve(weights.size());
  for (const RunningMean& w : weights)
    probabilities.push_back(0.45 * w.sum / energy + 0.45 * std::sqrt(w.sum_of_squares) / spread +
                            0.1 / static_cast<double>(weights.size()));
  table_ = DiscreteDistribution(probabilities);
}

std::optional<PathSampler::Sample> PathSampler::sample(Rng& rng) const {
  double u = rng.uniform();
  Sample path;
  path.entry = table_.sample(u);
  const int length = length_of(path.entry);
  const EndStrategy strategy = strategy_of(path.entry);

  const Vec3d v = scene_.camera().direction(rng.uniform2());
  PathTopology& topology = path.topology;
  topology.block_count = 1;
  path.coordinates(0) = v;
  RayFollower follower(scene_, v);
  const Bsdf* last_bsdf = nullptr;
  for (int k = 0; k + 1 < length; ++k) {
    const Hit hit = follower.next_hit();
    if (!hit.valid()) return std::nullopt;
    const SurfaceHit surface = follower.surface(hit);
    if (surface.bsdf == nullptr) return std::nullopt;
    last_bsdf = surface.bsdf;
    PathVertex& vertex = topology.vertices[topology.scatter_count++];
    vertex.hit = hit;
    vertex.delta = is_delta(*surface.bsdf);
    if (strategy == EndStrategy::Connect && k + 2 == length)
      return connect(std::move(path), surface, rng);
    const auto next =
        driftlight::sample(*surface.bsdf, surface.surface(), surface.wi, rng.uniform3());
    if (!next || !passes(surface.at, surface.wi, next->wo)) return std::nullopt;
    vertex.scattering = next->scattering;
    if (!vertex.delta) path.coordinates(topology.block_count++) = next->wo;
    follower.leave(surface, next->wo);
  }
  return end_by_hit(std::move(path), follower, last_bsdf);
}

std::optional<PathSampler::Sample> PathSampler::end_by_hit(Sample path, RayFollower& follower,
                                                           const Bsdf* last_bsdf) const {
  PathTopology& topology = path.topology;
  const Hit hit = follower.next_hit();
  if (!hit.valid()) {
    if (!scene_.environment()) return std::nullopt;
    topology.end = PathEnd::Environment;
    topology.emitter = *scene_.environment();
    return path;
  }
  const Shape& shape = scene_.shapes()[hit.shape];
  if (!shape.emitter) return std::nullopt;
  const Interaction<double> at = scene_.interact(hit, follower.ray());
  if (at.n_g.dot(follower.ray().direction) >= 0.0) return std::nullopt;  // the dark side
  topology.emitter = *shape.emitter;
  if (last_bsdf != nullptr && connects_to_area(*last_bsdf, shape)) {
    topology.end = PathEnd::AreaConnection;
    path.coordinates(topology.block_count - 1) = at.p;
  } else {
    topology.end = PathEnd::Hit;
    topology.vertices[topology.scatter_count].hit = hit;
  }
  return path;
}

std::optional<PathSampler::Sample> PathSampler::connect(Sample path, const SurfaceHit& surface,
                                                        Rng& rng) const {
  PathTopology& topology = path.topology;
  PathVertex& vertex = topology.vertices[topology.scatter_count - 1U];
  double u = rng.uniform();
  topology.emitter = scene_.sample_emitter(u);
  const Vec2d square = rng.uniform2();
  if (vertex.delta) return std::nullopt;
  const Emitter& emitter = scene_.emitters()[topology.emitter];

  if (is_environment(emitter)) {
    const auto* map = std::get_if<EnvironmentMap>(&emitter);
    const Vec3d wo = map != nullptr ? map->sample(square.x(), square.y())
                                    : square_to_sphere(square.x(), square.y());
    if (!passes(surface.at, surface.wi, wo)) return std::nullopt;
    const Vec3d start = scene_.leave(surface.at.p, surface.at.n_g, wo);
    if (scene_.occluded_to_infinity(start, wo)) return std::nullopt;
    vertex.scattering = surface.side(wo);
    topology.end = PathEnd::Environment;
    path.coordinates(topology.block_count++) = wo;
    return path;
  }

  const auto* light = std::get_if<AreaEmitter>(&emitter);
  EmitterPoint y;
  if (light != nullptr)
    y = scene_.sample_area(*light, square.x(), square.y());
  else
    y.p = std::get<PointEmitter>(emitter).position;
  const Vec3d edge = y.p - surface.at.p;
  if (!passes(surface.at, surface.wi, edge)) return std::nullopt;
  if (connection_status(scene_, surface, emitter, y) != TraceStatus::Ok) return std::nullopt;
  vertex.scattering = surface.side(edge);
  if (light == nullptr) {
    topology.end = PathEnd::PointConnection;
  } else if (connects_to_area(*surface.bsdf, scene_.shapes()[light->shape])) {
    topology.end = PathEnd::AreaConnection;
    path.coordinates(topology.block_count++) = y.p;
  } else {
    // The chart of this path is its last direction: find the primitive that it hits.
    const Vec3d wo = edge.normalized();
    const Vec3d start = scene_.leave(surface.at.p, surface.at.n_g, wo);
    const Hit hit = scene_.intersect(start, wo);
    if (hit.shape != light->shape) return std::nullopt;
    topology.end = PathEnd::Hit;
    topology.vertices[topology.scatter_count].hit = hit;
    path.coordinates(topology.block_count++) = wo;
  }
  return path;
}

double PathSampler::log_density(const PathTopology& topology,
                                const PathCoordinates& coordinates) const {
  const int length = topology.length();
  if (length > max_depth_) return -std::numeric_limits<double>::infinity();
  const double hit = table_.probability(entry_of(length, EndStrategy::Hit));
  const double connect =
      length > 1 ? table_.probability(entry_of(length, EndStrategy::Connect)) : 0.0;
  DensityVisitor visitor(scene_, topology.emitter, hit, connect);
  walk<double>(scene_, topology, coordinates, visitor);
  return visitor.log_density();
}

}  // namespace driftlight
