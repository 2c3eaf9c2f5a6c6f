// SPDX-License-Identifier: Apache-2.0
#include "remainder.h"

#include <cmath>

#include "path_density.h"

namespace driftlight {
namespace {

/// Brighter paths are left to the samples: chains sum in fixed point.
constexpr double kMostW = 1e9;

}  // namespace

double Remainder::left(double weight, const FoundPath& path) const {
  const double tau = this->tau(path.s + path.t - 1);
  const double ceiling = this->ceiling(path.s + path.t - 1);
  return weight > tau && weight < kMostW ? path.factor * (std::min(weight, ceiling) - tau) : 0.0;
}

std::optional<BrightPath> Remainder::bright_path(const FoundPath& path,
                                                 PhaseSpace phase_space) const {
  return bright_path(state_of(scene_, path, phase_space));
}

std::optional<BrightPath> Remainder::bright_path(const VertexPath& path,
                                                 PhaseSpace phase_space) const {
  return bright_path(state_of(scene_, path, phase_space));
}

std::optional<BrightPath> Remainder::bright_path(
    const std::optional<PathSampler::Sample>& path) const {
  if (!path) return std::nullopt;
  BrightPath bright{path->topology, path->coordinates,
                    contribution(scene_, path->topology, path->coordinates), Share{}};
  bright.share = share(bright.topology, bright.coordinates, bright.contribution);
  if (!std::isfinite(bright.share.log_remainder)) return std::nullopt;
  return bright;
}

Share Remainder::share(const PathTopology& topology, const PathCoordinates& coordinates,
                       const Contribution& contribution) const {
  const StrategyDensities densities = strategy_densities(scene_, guide_, topology, coordinates);
  const int n = topology.length();
  // Bidirectional path tracing leaves emitters that are seen directly to s = 0.
  double q = densities.by_light_vertices[0];
  for (int s = 1; s <= n && n > 1; ++s)
    q += densities.by_light_vertices[static_cast<std::size_t>(s)];
  return share(n, contribution, std::log(q));
}

Share Remainder::share(const VertexPath& path) const {
  return share(path.edges, path.contribution(), log_density(path, guide_));
}

Share Remainder::share(int edges, const Contribution& contribution, double log_q) const {
  Share share;
  share.film = contribution.film;
  share.brightness = brightness_(share.film);
  share.w = std::exp(contribution.log_target - log_q - std::log(share.brightness));
  share.tau = tau(edges);
  const bool remains = share.w < kMostW && std::isfinite(log_q);
  const double excess = std::max(0.0, std::min(share.w, ceiling(edges)) - share.tau);
  share.log_remainder =
      remains ? log_q + std::log(excess) : -std::numeric_limits<double>::infinity();
  return share;
}

void RemainderChain::start_at(const BrightPath& path) {
  current_.state.topology = path.topology;
  current_.state.coordinates = path.coordinates;
  current_.state.contribution = path.contribution;
  current_.state.has_step = false;
  current_.share = path.share;
}

double RemainderChain::propose(Visit& from, Visit& to, MutationStage stage, Rng& rng,
                               Rejections& rejections) {
  const bool proposed = stage == MutationStage::Second
                            ? small_step_.propose_again(from.state, to.state, rng, rejections)
                            : small_step_.propose(from.state, to.state, rng, rejections);
  if (!proposed) return 0.0;
  to.share = remainder_.share(to.state.topology, to.state.coordinates, to.state.contribution);
  if (!std::isfinite(to.share.log_remainder)) {
    ++rejections.hastings;
    return 0.0;
  }
  const auto densities = small_step_.log_densities(from.state, to.state, rejections);
  if (!densities) return 0.0;
  return acceptance_ratio(from.share.log_remainder, to.share.log_remainder, densities->forward,
                          densities->reverse);
}

}  // namespace driftlight
