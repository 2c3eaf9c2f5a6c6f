// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <utility>

#include "mutation_loop.h"
#include "path_mutation.h"
#include "remainder.h"

namespace driftlight {

/// Runs short chains that leave the remainder invariant, as RemainderChain does, by the lens,
/// multi-chain and caustic perturbations of Veach and Guibas 1997 (path_mutation.h). These move a
/// path at one end and keep its vertices at the other, so that what is narrow there, such as an
/// opening that the light comes through, does not hold them up. They keep the lobes, by which a
/// path has a chart or none, so they stay among the paths that chains start from. The sensor is a
/// pinhole.
class PerturbationChain {
 public:
  /// Of paths of at most so many edges.
  PerturbationChain(const Scene& scene, const Remainder& remainder, int max_depth);

  /// The path that the next chains start from. False if by rounding nothing of it remains.
  bool start_at(const FoundPath& path);

  /// As RemainderChain::run.
  template <class Splat>
  void run(std::uint64_t mutations, Rng& rng, const Splat& splat) {
    figures_.rejections.hastings += run_mutations(
        start_, visits_, mutations, rng,
        [&](const Visit& from, Visit& to) { return propose(from, to, rng); },
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

  /// The acceptance probability of a perturbation from `from` to `to`.
  double propose(const Visit& from, Visit& to, Rng& rng);

  const Scene& scene_;
  const Remainder& remainder_;
  PathMutation mutation_;
  Visit start_;
  std::array<Visit, 2> visits_;
  ChainFigures figures_;
};

}  // namespace driftlight
