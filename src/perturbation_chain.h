// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <utility>

#include "mutation_loop.h"
#include "path_mutation.h"
#include "remainder.h"

namespace driftlight {

/// Runs short chains that leave the remainder invariant, as RemainderChain does, by the
/// perturbations of path_mutation.h. Those of Veach and Guibas 1997 move a path at one end and keep
/// its vertices at the other, so that what is narrow there, such as an opening that the light comes
/// through, does not hold them up; manifold perturbations also keep what lies behind glass. All
/// keep the lobes, by which a path has a chart or none, so they stay among the paths that chains
/// start from. The sensor is a pinhole.
class PerturbationChain {
 public:
  /// Of paths of at most so many edges; `manifold_probability` as MutationLimits has it.
  PerturbationChain(const Scene& scene, const DelayedRejection& delayed_rejection,
                    const Remainder& remainder, int max_depth, double manifold_probability = 0);

  /// The path that the next chains start from, not yet evaluated. False if by rounding nothing of
  /// it remains.
  bool start_at(const VertexPath& path);

  /// As RemainderChain::run.
  template <class Splat>
  void run(std::uint64_t mutations, Rng& rng, const Splat& splat) {
    run_mutations(
        start_, visits_, {mutations, delayed_rejection_.on}, rng, figures_,
        [&](const Visit& from, Visit& to, MutationStage stage, Rng& numbers,
            Rejections& rejections) { return propose(from, to, stage, numbers, rejections); },
        [&](const Visit& at, double weight) {
          splat(at.share, at.path.contribution().color, weight);
        });
  }

  /// Since they were last taken.
  ChainFigures take_statistics() { return std::exchange(figures_, {}); }

 private:
  struct Visit {
    VertexPath path;
    Share share;
  };

  /// As run_mutations has it.
  double propose(const Visit& from, Visit& to, MutationStage stage, Rng& rng,
                 Rejections& rejections) const;

  const Scene& scene_;
  DelayedRejection delayed_rejection_;
  const Remainder& remainder_;
  PathMutation mutation_;
  Visit start_;
  std::array<Visit, 3> visits_;
  ChainFigures figures_;
};

}  // namespace driftlight
