// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <utility>

#include "mutation_loop.h"
#include "path_mutation.h"
#include "remainder.h"

namespace driftlight {

/// A chain that leaves the remainder invariant, as RemainderChain does, by the perturbations of
/// path_mutation.h. Those of Veach and Guibas 1997 move a path at one end and keep its vertices at
/// the other, so that what is narrow there, such as an opening that the light comes through, does
/// not hold them up; manifold perturbations also keep what lies behind glass. Like Langevin steps
/// they keep the sequence of lobes, by which a path has a chart or none and splitting takes it or
/// not: what has another one is refused. The sensor is a pinhole.
class PerturbationChain {
 public:
  /// Of paths of at most so many edges; `manifold_probability` as MutationLimits has it.
  PerturbationChain(const Scene& scene, const DelayedRejection& delayed_rejection,
                    const Remainder& remainder, int max_depth, double manifold_probability);

  /// At a path that need not be evaluated. False if by rounding nothing of it remains.
  bool start_at(const VertexPath& path);
  const VertexPath& current() const { return current_.path; }

  /// As RemainderChain::run.
  template <class Splat>
  bool run(std::uint64_t mutations, Rng& rng, const Splat& splat) {
    Visit& last = run_mutations(
        current_, visits_, {mutations, delayed_rejection_.on}, rng, figures_,
        [&](const Visit& from, Visit& to, MutationStage stage, Rng& numbers,
            Rejections& rejections) { return propose(from, to, stage, numbers, rejections); },
        [&](const Visit& at, double weight) {
          splat(at.share, at.path.contribution().color, weight);
        });
    if (&last == &current_) return false;
    std::swap(current_, last);
    return true;
  }
  template <class Splat>
  void stay(std::uint64_t mutations, const Splat& splat) const {
    splat(current_.share, current_.path.contribution().color, static_cast<double>(mutations));
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
  Visit current_;
  std::array<Visit, 3> visits_;
  ChainFigures figures_;
};

}  // namespace driftlight
