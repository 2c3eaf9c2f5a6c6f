// SPDX-License-Identifier: Apache-2.0
/// A Metropolis-Hastings chain over light paths: large steps and Langevin steps.
#pragma once

#include <optional>

#include "driftlight/film.h"
#include "driftlight/path_sampler.h"
#include "driftlight/running_mean.h"
#include "driftlight/small_step.h"

namespace driftlight {

class Chain {
 public:
  /// Starts at a path that carries light. The options must outlive it; an automatic probability of
  /// large steps is 0.1. Small steps are recorded in `layers` unless it is null.
  Chain(const Scene& scene, const PathSampler& sampler, const LangevinOptions& options, Film& film,
        const PathSampler::Sample& start, Rng rng, StepLayers* layers = nullptr);

  /// Shows the probe each state whose step is prepared from now on.
  void observe(GradientProbe& probe) { small_step_.observe(&probe); }

  /// Runs mutations, each splatting both states with weights 1 - a and a.
  void run(std::uint64_t mutations);
  /// Deposits what the current state has gathered since it was entered.
  void flush();

  const LangevinStatistics& statistics() const { return statistics_; }
  /// Weights f / q of all large steps proposed so far: independent estimates of b.
  const RunningMean& weights() const { return weights_; }
  const ChainState& state() const { return states_[current_]; }

 private:
  ChainState& current() { return states_[current_]; }
  ChainState& proposed() { return states_[proposed_]; }
  /// Each returns the acceptance probability; none if there is no valid proposal.
  std::optional<double> propose_large();
  std::optional<double> propose_small();
  /// Delayed rejection: a small step, and where it is refused a second one.
  void take_delayed_step();
  /// The acceptance probability of a second step, behind the ghost that is the proposed state,
  /// valid or not, accepted with this probability.
  double propose_second(double first_acceptance, bool valid);
  /// Moves with this probability to the state of this index; true if it moved.
  bool resolve(double acceptance, std::size_t index);

  const Scene& scene_;
  const PathSampler& sampler_;
  double large_step_probability_;
  SmallStep small_step_;
  Film& film_;
  Rng rng_;
  ChainState states_[3];
  std::size_t current_ = 0;
  std::size_t proposed_ = 1;
  std::size_t second_ = 2;  ///< proposed by a second step
  double gathered_ = 0;     ///< weight of the current state not yet splatted
  StepLayers* layers_;
  LangevinStatistics statistics_;
  RunningMean weights_;
};

}  // namespace driftlight
