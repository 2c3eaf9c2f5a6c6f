// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>

#include "perturbation_chain.h"
#include "remainder.h"

namespace driftlight {

/// Runs short chains that leave the remainder invariant, in turns of Langevin steps and turns of
/// perturbations. Where one kind finds no way out of a narrow place the other often does; and the
/// light of a heavy start that stays where it is shows as a spot.
///
/// Which kind a turn is of is drawn without a look at the path. A path that has no form for a kind
/// stays where it is in its turns: neither kind changes the lobes, by which a path has a chart or
/// none, so each leaves the remainder invariant among the paths that it moves.
class MixedChain {
 public:
  /// So large a share of the turns is of perturbations; more than 0 with a pinhole only. Steps are
  /// recorded in `layers` unless it is null. All references must outlive it.
  MixedChain(const Scene& scene, const LangevinOptions& options, const KernelOptions& kernel,
             double perturbations, double manifold_probability, const Remainder& remainder,
             StepLayers* layers);

  /// The path that the next chains start from. False if no turn could move it.
  bool start_at(const FoundPath& path);
  /// The same of a state that has a remainder.
  void start_at(const BrightPath& path);

  /// The start as a state of the phase space, if it has one and any steps are taken.
  const std::optional<BrightPath>& start() const { return start_; }

  /// Shows the probe, unless it is null, each state whose step is prepared from now on.
  void observe(GradientProbe* probe) { steps_.observe(probe); }

  /// From the start, as RemainderChain::run.
  template <class Splat>
  void run(std::uint64_t mutations, Rng& rng, const Splat& splat);

  /// Since they were last taken.
  ChainFigures take_statistics();

 private:
  /// Mutations of a turn: to bring a path from the one chain to the other costs about as much as
  /// one.
  static constexpr std::uint64_t kTurn = 10;

  bool mixes() const { return perturbations_ > 0.0 && perturbations_ < 1.0; }
  /// Brings both chains to the start.
  bool rewind();
  /// Each brings its chain to where the path is. False if it has no form there.
  bool enter_steps();
  bool enter_perturbations();

  const Scene& scene_;
  PhaseSpace phase_space_;
  const Remainder& remainder_;
  double perturbations_;
  RemainderChain steps_;
  PerturbationChain perturbed_;
  std::optional<BrightPath> start_;
  std::optional<VertexPath> start_by_vertices_;
  // Whether the chain is where the path is.
  bool in_steps_ = false;
  bool in_perturbations_ = false;
  bool at_start_ = false;  ///< the path is
};

template <class Splat>
void MixedChain::run(std::uint64_t mutations, Rng& rng, const Splat& splat) {
  if (!at_start_) rewind();
  for (std::uint64_t left = mutations; left > 0;) {
    const std::uint64_t turn = mixes() ? std::min(kTurn, left) : left;
    left -= turn;
    const bool perturbs = mixes() ? rng.uniform() < perturbations_ : perturbations_ > 0.0;
    if (perturbs && enter_perturbations()) {
      if (perturbed_.run(turn, rng, splat)) in_steps_ = at_start_ = false;
    } else if (!perturbs && enter_steps()) {
      if (steps_.run(turn, rng, splat)) in_perturbations_ = at_start_ = false;
    } else if (in_steps_) {
      steps_.stay(turn, splat);
    } else {
      perturbed_.stay(turn, splat);
    }
  }
}

}  // namespace driftlight
