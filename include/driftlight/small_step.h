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

/// True for Ok; what made a proposal fail is counted.
bool succeeded(TraceStatus status, Rejections& rejections);

/// pi(y) p(x|y) / (pi(x) p(y|x)) (E63.6); 0 if anything is NaN.
double acceptance_ratio(double log_target_from, double log_target_to, double log_pdf_forward,
                        double log_pdf_reverse);

/// log of the acceptance probability min(1, pi(y) p(x|y) / (pi(x) p(y|x))) (E63.6); -infinity if
/// anything is NaN.
double log_acceptance(double log_target_from, double log_target_to, double log_pdf_forward,
                      double log_pdf_reverse);

/// log of p1(y | x) (1 - a1(x, y)), the density of a first proposal that is refused: the ghost y of
/// delayed rejection. With it second proposals z, drawn from p2(z | x) whatever y was, are accepted
/// with probability
///   min(1, pi(z) p1(y | z) (1 - a1(z, y)) p2(x | z) / (pi(x) p1(y | x) (1 - a1(x, y)) p2(z | x)))
/// (Tierney and Mira 1999; Green and Mira 2001): log_acceptance of the targets times the ghost's
/// densities. -infinity where the first proposal is certainly accepted.
double log_refused(double log_pdf, double log_first_acceptance);

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
  /// With delayed rejection second steps have so many times the scale of the first. Both references
  /// must outlive it.
  SmallStep(const Scene& scene, const KernelOptions& options,
            std::optional<double> second_scale = std::nullopt)
      : scene_(scene), options_(options), second_scale_(second_scale) {}

  bool delays_rejection() const { return second_scale_.has_value(); }

  /// Shows the probe, unless it is null, each state whose step is prepared from now on.
  void observe(GradientProbe* probe) { probe_ = probe; }

  /// Draws a step from `from` and traces and evaluates where it leads; what makes it fail is
  /// counted.
  bool propose(ChainState& from, ChainState& to, Rng& rng, Rejections& rejections);
  /// The same by a second step from the same state.
  bool propose_again(ChainState& from, ChainState& to, Rng& rng, Rejections& rejections);
  /// Those of the step just proposed; none if either is 0.
  std::optional<LogDensities> log_densities(ChainState& from, ChainState& to,
                                            Rejections& rejections);
  /// log p(to | from) of a state whose step is prepared and finite, at the scale of the first step,
  /// whether or not a path has those coordinates; -infinity beyond the horizon.
  double log_first_density(const ChainState& from, const PathCoordinates& to) const;
  /// Counts the step just proposed from `from` in the layers.
  void record(ChainState& from, double acceptance, StepLayers& layers) const;

 private:
  void prepare(ChainState& state);
  bool step(ChainState& from, ChainState& to, Rng& rng, Rejections& rejections);

  const Scene& scene_;
  const KernelOptions& options_;
  std::optional<double> second_scale_;
  GradientProbe* probe_ = nullptr;
  double first_scale_ = 0;
  double scale_ = 0;  ///< of the step just proposed
};

}  // namespace driftlight
