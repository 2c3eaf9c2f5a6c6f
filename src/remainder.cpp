// SPDX-License-Identifier: Apache-2.0
#include "remainder.h"

#include <cmath>

#include "path_density.h"

namespace driftlight {
namespace {

/// Brighter paths are left to the samples: chains sum in fixed point.
constexpr double kMostW = 1e9;
/// tau of emitters that are seen directly, over that of other light.
constexpr double kSeenTau = 16;

}  // namespace

std::optional<BrightPath> Remainder::bright_path(double weight, const FoundPath& path,
                                                 PhaseSpace phase_space) const {
  if (!(weight > tau_)) return std::nullopt;
  const auto sample = state_of(scene_, path, phase_space);
  if (!sample) return std::nullopt;
  BrightPath bright{sample->topology, sample->coordinates,
                    contribution(scene_, sample->topology, sample->coordinates), Share{}};
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
  Share share;
  share.film = contribution.film;
  share.brightness = brightness_(share.film);
  share.w = std::exp(contribution.log_target - std::log(q * share.brightness));
  share.tau = n > 1 ? tau_ : kSeenTau * tau_;
  const bool remains = share.w < kMostW && std::isfinite(q);
  share.log_remainder =
      remains ? std::log(q) + std::log(share.excess()) : -std::numeric_limits<double>::infinity();
  return share;
}

void RemainderChain::start_at(const BrightPath& path) {
  start_.state.topology = path.topology;
  start_.state.coordinates = path.coordinates;
  start_.state.contribution = path.contribution;
  start_.state.has_step = false;
  start_.share = path.share;
}

double RemainderChain::propose(Visit& from, Visit& to, Rng& rng) {
  ++figures_.small_step.proposed;
  if (!small_step_.propose(from.state, to.state, rng, figures_.rejections)) return 0.0;
  to.share = remainder_.share(to.state.topology, to.state.coordinates, to.state.contribution);
  if (!std::isfinite(to.share.log_remainder)) {
    ++figures_.rejections.hastings;
    return 0.0;
  }
  const auto densities = small_step_.log_densities(from.state, to.state, figures_.rejections);
  if (!densities) return 0.0;
  const double acceptance = std::exp(log_acceptance(
      from.share.log_remainder, to.share.log_remainder, densities->forward, densities->reverse));
  figures_.small_step.accepted += acceptance;
  return acceptance;
}

}  // namespace driftlight
