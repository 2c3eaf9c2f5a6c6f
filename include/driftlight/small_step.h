// SPDX-License-Identifier: Apache-2.0
/// The small step of a chain: a state, its Langevin proposal and the exact ratio of densities.
#pragma once

#include <limits>
#include <optional>

#include "driftlight/contribution.h"
#include "driftlight/gradient_probe.h"
#include "driftlight/kernel.h"
#include "driftlight/render.h"
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

/// log p(to | from) and log p(from | to)
struct LogDensities {
  double forward;
  double reverse;
};

/// Proposals of the kernel (E63.3), whatever the target of the chain: its states carry light.
class SmallStep {
 public:
  SmallStep(const Scene& scene, const KernelOptions& options) : scene_(scene), options_(options) {}

  /// Shows the probe, unless it is null, each state whose step is prepared from now on.
  void observe(GradientProbe* probe) { probe_ = probe; }

  /// Draws a step from `from` and traces and evaluates where it leads; what makes it fail is
  /// counted.
  bool propose(ChainState& from, ChainState& to, Rng& rng, Rejections& rejections);
  /// Those of the step just proposed; none if either is 0.
  std::optional<LogDensities> log_densities(ChainState& from, ChainState& to,
                                            Rejections& rejections);
  /// Counts the step just proposed from `from` in the layers.
  void record(ChainState& from, double acceptance, StepLayers& layers) const;

 private:
  void prepare(ChainState& state);

  const Scene& scene_;
  const KernelOptions& options_;
  GradientProbe* probe_ = nullptr;
  double scale_ = 0;
};

}  // namespace driftlight
