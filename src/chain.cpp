// SPDX-License-Identifier: Apache-2.0
#include "driftlight/chain.h"

#include <cmath>

namespace driftlight {

Chain::Chain(const Scene& scene, const PathSampler& sampler, const LangevinOptions& options,
             Film& film, const PathSampler::Sample& start, Rng rng, StepLayers* layers)
    : scene_(scene),
      sampler_(sampler),
      large_step_probability_(options.large_step_probability.value_or(0.1)),
      small_step_(scene, options.kernel, options.delayed_rejection.scale()),
      film_(film),
      rng_(rng),
      layers_(layers) {
  current().topology = start.topology;
  current().coordinates = start.coordinates;
  current().contribution = contribution(scene, start.topology, start.coordinates);
}

void Chain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const bool large = rng_.uniform() < large_step_probability_;
    if (!large && small_step_.delays_rejection()) {
      take_delayed_step();
      continue;
    }
    KernelStatistics& kernel = large ? statistics_.large_step : statistics_.small_step;
    const std::optional<double> acceptance = large ? propose_large() : propose_small();
    ++kernel.proposed;
    kernel.accepted += acceptance.value_or(0.0);
    if (layers_ != nullptr && !large)
      small_step_.record(current(), acceptance.value_or(0.0), *layers_);
    const bool moved = resolve(acceptance.value_or(0.0), proposed_);
    if (acceptance && !moved && !large) ++statistics_.rejections.hastings;
  }
  statistics_.mutations += mutations;
}

/// acceptance = min(1, w(y) / w(x)), w = f / q
std::optional<double> Chain::propose_large() {
  const auto sample = sampler_.sample(rng_);
  double log_weight = -std::numeric_limits<double>::infinity();
  ChainState& to = proposed();
  if (sample) {
    to.topology = sample->topology;
    to.coordinates = sample->coordinates;
    to.contribution = contribution(scene_, to.topology, to.coordinates);
    log_weight = to.contribution.log_target - sampler_.log_density(to.topology, to.coordinates);
    to.has_step = false;
    to.log_weight = log_weight;
  }
  const double weight = std::exp(log_weight);
  if (!std::isfinite(weight)) {
    ++statistics_.rejections.non_finite;
    weights_.add(0.0);
    return std::nullopt;
  }
  weights_.add(weight);
  if (weight == 0.0) return std::nullopt;
  ChainState& from = current();
  if (std::isnan(from.log_weight))
    from.log_weight =
        from.contribution.log_target - sampler_.log_density(from.topology, from.coordinates);
  return std::exp(log_acceptance(from.log_weight, to.log_weight, 0.0, 0.0));
}

std::optional<double> Chain::propose_small() {
  ChainState& from = current();
  ChainState& to = proposed();
  Rejections& rejections = statistics_.rejections;
  if (!small_step_.propose(from, to, rng_, rejections)) return std::nullopt;
  const auto densities = small_step_.log_densities(from, to, rejections);
  if (!densities) return std::nullopt;
  return std::exp(log_acceptance(from.contribution.log_target, to.contribution.log_target,
                                 densities->forward, densities->reverse));
}

/// The states get weights whose mean is that of what the chain visits: the first proposal 1 if it
/// is accepted, else the second one a2 and the current state 1 - a2.
void Chain::take_delayed_step() {
  KernelStatistics& first = statistics_.small_step;
  const bool valid = small_step_.propose(current(), proposed(), rng_, statistics_.rejections);
  double acceptance = 0.0;
  if (valid) {
    const auto densities = small_step_.log_densities(current(), proposed(), statistics_.rejections);
    if (densities)
      acceptance = std::exp(log_acceptance(current().contribution.log_target,
                                           proposed().contribution.log_target, densities->forward,
                                           densities->reverse));
  }
  ++first.proposed;
  first.accepted += acceptance;
  if (rng_.uniform() < acceptance) {
    if (layers_ != nullptr) small_step_.record(current(), 1.0, *layers_);
    resolve(1.0, proposed_);
    return;
  }
  if (acceptance > 0.0) ++statistics_.rejections.hastings;
  const double second = propose_second(acceptance, valid);
  if (layers_ != nullptr) small_step_.record(current(), second, *layers_);
  const bool moved = resolve(second, second_);
  if (second > 0.0 && !moved) ++statistics_.rejections.hastings;
}

double Chain::propose_second(double first_acceptance, bool valid) {
  ChainState& from = current();
  ChainState& ghost = proposed();
  ChainState& to = states_[second_];
  Rejections& rejections = statistics_.rejections;
  ++statistics_.second_step.proposed;
  if (!small_step_.propose_again(from, to, rng_, rejections)) return 0.0;
  const auto densities = small_step_.log_densities(from, to, rejections);
  if (!densities) return 0.0;
  const double log_target = to.contribution.log_target;
  const double to_ghost = small_step_.log_first_density(to, ghost.coordinates);
  // A ghost that is no path, or has no step, would be refused from everywhere.
  double log_first = -std::numeric_limits<double>::infinity();
  if (valid && ghost.finite)
    log_first = log_acceptance(log_target, ghost.contribution.log_target, to_ghost,
                               small_step_.log_first_density(ghost, to.coordinates));
  const double here = log_refused(small_step_.log_first_density(from, ghost.coordinates),
                                  std::log(first_acceptance));
  const double acceptance = std::exp(log_acceptance(from.contribution.log_target + here,
                                                    log_target + log_refused(to_ghost, log_first),
                                                    densities->forward, densities->reverse));
  statistics_.second_step.accepted += acceptance;
  return acceptance;
}

bool Chain::resolve(double acceptance, std::size_t index) {
  ++statistics_.path_length[static_cast<std::size_t>(current().topology.length())];
  gathered_ += 1.0 - acceptance;
  const bool accept = rng_.uniform() < acceptance;
  if (accept) {
    flush();
    // What is left is free for the next proposals.
    std::size_t& free = index == proposed_ ? proposed_ : second_;
    free = current_;
    current_ = index;
    gathered_ = acceptance;
  } else if (acceptance > 0.0) {
    const ChainState& to = states_[index];
    film_.splat(to.contribution.film, to.contribution.color, acceptance);
  }
  return accept;
}

void Chain::flush() {
  if (gathered_ > 0.0)
    film_.splat(current().contribution.film, current().contribution.color, gathered_);
  gathered_ = 0.0;
}

}  // namespace driftlight
