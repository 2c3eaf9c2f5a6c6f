// SPDX-License-Identifier: Apache-2.0
#include "driftlight/path_sampler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "path_density.h"
#include "path_join.h"

namespace driftlight {
namespace {

/// Draws v_0 and `surface_vertices` vertices; the last of them scatters only if `scatter_last`.
std::optional<CameraPart> sample_camera_part(const Scene& scene, PhaseSpace phase_space,
                                             int surface_vertices, bool scatter_last, Rng& rng) {
  const Camera& camera = scene.camera();
  const Vec2d film = rng.uniform2();
  const Vec3d lens = sample_lens(camera, rng);
  const Vec3d v = camera.direction(film, lens);
  CameraPart part = begin_camera_part(scene, phase_space, v, lens);
  PathTopology& topology = part.path.topology;
  if (surface_vertices == 0 && !scatter_last) return part;
  part.path.coordinates(topology.block_count++) = v;
  for (int k = 1; k <= surface_vertices; ++k) {
    const Hit hit = part.follower.next_hit();
    if (!hit.valid()) return std::nullopt;
    const SurfaceHit surface = part.follower.surface(hit);
    if (surface.bsdf == nullptr) return std::nullopt;
    part.last = surface;
    PathVertex& vertex = topology.vertices[topology.scatter_count++];
    vertex.hit = hit;
    vertex.delta = is_delta(*surface.bsdf);  // of the last, whose lobe may not be drawn
    if (k == surface_vertices && !scatter_last) return part;
    const auto next =
        driftlight::sample(*surface.bsdf, surface.surface(), surface.wi, rng.uniform3());
    if (!next || !passes(surface.at, surface.wi, next->wo)) return std::nullopt;
    vertex.delta = next->delta;
    vertex.scattering = next->scattering;
    if (!vertex.delta) part.path.coordinates(topology.block_count++) = next->wo;
    part.follower.leave(surface, next->wo);
  }
  return part;
}

}  // namespace

PathSampler::PathSampler(const Scene& scene, int max_depth, LargeSteps large_steps, int min_depth,
                         PhaseSpace phase_space)
    : scene_(scene), phase_space_(phase_space), first_of_length_{0} {
  for (int n = 1; n <= max_depth; ++n) {
    first_of_length_.push_back(entry_count());
    if (n < min_depth) continue;
    const int most = large_steps == LargeSteps::Bdpt ? n : std::min(n - 1, 1);
    for (int s = 0; s <= most; ++s) strategies_.push_back({n, s});
  }
  first_of_length_.push_back(entry_count());
  table_ = DiscreteDistribution(spread(1.0));
}

/// A probability spread evenly, one half over all entries and the other over s <= 1: these are few,
/// and find what no other strategy can, light behind mirrors and glass.
std::vector<double> PathSampler::spread(double probability) const {
  const auto from_sensor = [](const Strategy& e) { return e.light_vertices <= 1; };
  const auto count = std::count_if(strategies_.begin(), strategies_.end(), from_sensor);
  std::vector<double> result;
  result.reserve(strategies_.size());
  for (const Strategy& e : strategies_)
    result.push_back(0.5 * probability *
                     (1.0 / static_cast<double>(strategies_.size()) +
                      (from_sensor(e) ? 1.0 / static_cast<double>(count) : 0.0)));
  return result;
}

void PathSampler::learn(const std::vector<RunningMean>& weights) {
  double energy = 0;
  double spread_total = 0;
  for (const RunningMean& w : weights) {
    energy += w.sum;
    spread_total += std::sqrt(w.sum_of_squares);
  }
  if (!(energy > 0.0)) return;
  std::vector<double> probabilities = spread(0.1);
  for (std::size_t i = 0; i < weights.size(); ++i)
    probabilities[i] +=
        0.45 * weights[i].sum / energy + 0.45 * std::sqrt(weights[i].sum_of_squares) / spread_total;
  table_ = DiscreteDistribution(probabilities);
}

std::optional<PathSampler::Sample> PathSampler::sample(Rng& rng) const {
  double u = rng.uniform();
  const int entry = table_.sample(u);
  const auto [n, s] = strategies_[static_cast<std::size_t>(entry)];
  auto camera = sample_camera_part(scene_, phase_space_, s == 0 ? n - 1 : n - s, s == 0, rng);
  if (!camera) return std::nullopt;
  camera->path.entry = entry;
  if (s == 0) return end_by_hit(scene_, *camera);
  const bool camera_is_delta = camera->last && is_delta(*camera->last->bsdf);
  if (camera_is_delta) return std::nullopt;
  const auto light = sample_light_part(scene_, s - 1, rng);
  if (!light) return std::nullopt;
  return join(scene_, *camera, *light);
}

double PathSampler::log_density(const PathTopology& topology,
                                const PathCoordinates& coordinates) const {
  const auto n = static_cast<std::size_t>(topology.length());
  const bool too_long = n + 1 >= first_of_length_.size();
  if (too_long || first_of_length_[n] == first_of_length_[n + 1])
    return -std::numeric_limits<double>::infinity();
  const StrategyDensities q =
      strategy_densities(scene_, EmissionGuide(scene_), topology, coordinates);
  const int first = first_of_length_[n];
  const int end = first_of_length_[n + 1];
  double sum = 0;
  for (int entry = first; entry < end; ++entry)
    sum += table_.probability(entry) * q.by_light_vertices[static_cast<std::size_t>(entry - first)];
  return std::log(sum);
}

}  // namespace driftlight
