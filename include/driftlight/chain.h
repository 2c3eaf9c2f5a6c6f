// SPDX-License-Identifier: Apache-2.0
/// A Metropolis-Hastings chain over light paths: large steps and Langevin steps.
#pragma once

#include <limits>
#include <optional>

#include "driftlight/contribution.h"
#include "driftlight/film.h"
#include "driftlight/gradient.h"
#include "driftlight/gradient_probe.h"
#include "driftlight/kernel.h"
#include "driftlight/path_sampler.h"
#include "driftlight/render.h"
#include "driftlight/running_mean.h"
#include "driftlight/step_layers.h"

namespace driftlight {

/// A path with all that the kernels know of it.
struct ChainState {
  PathTopology topology;
  PathCoordinates coordinates;
  Contribution contribution;
  Chart chart;
  StepDistribution step;
  bool has_step = false;               ///< chart and step are computed
  bool finite = true;                  ///< the derivatives behind the step are; else there is none
  std::optional<StepFigures> figures;  ///< of the step; only where layers are recorded
  /// log (f / q), the weight of a large step; NaN until it is needed.
  double log_weight = std::numeric_limits<double>::quiet_NaN();
};

/// log of the acceptance probability min(1, pi(y) p(x|y) / (pi(x) p(y|x))) (E63.6); -infinity if
/// anything is NaN.
double log_acceptance(double log_target_from, double log_target_to, double log_pdf_forward,
                      double log_pdf_reverse);

/// Chart and step distribution of a state, by the kernel's options. A state whose derivatives are
/// not finite has no step, from or to it: a function of the state, so the balance holds.
void prepare_step(const Scene& scene, const KernelOptions& options, ChainState& state);

class Chain {
 public:
  /// Starts at a path that carries light. Small steps are recorded in `layers` unless it is null.
  Chain(const Scene& scene, const PathSampler& sampler, const LangevinOptions& options, Film& film,
        const PathSampler::Sample& start, Rng rng, StepLayers* layers = nullptr);

  /// Shows the probe each state whose step is prepared from now on.
  void observe(GradientProbe& probe) { probe_ = &probe; }

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
  ChainState& proposed() { return states_[1 - current_]; }
  /// Each returns the acceptance probability; none if there is no valid proposal.
  std::optional<double> propose_large();
  std::optional<double> propose_small();
  void prepare(ChainState& state);
  /// Traces and evaluates proposed(); counts why it fails.
  bool evaluate_proposed();
  /// Counts a small step that starts at current() in the layers.
  void record_step(double acceptance);
  /// Moves with this probability; true if it moved.
  bool resolve(double acceptance);

  const Scene& scene_;
  const PathSampler& sampler_;
  const LangevinOptions& options_;
  Film& film_;
  Rng rng_;
  ChainState states_[2];
  std::size_t current_ = 0;
  double gathered_ = 0;  ///< weight of the current state not yet splatted
  double scale_ = 0;     ///< of the last small step
  StepLayers* layers_;
  GradientProbe* probe_ = nullptr;
  LangevinStatistics statistics_;
  RunningMean weights_;
};

}  // namespace driftlight
