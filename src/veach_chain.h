// SPDX-License-Identifier: Apache-2.0
/// A Metropolis chain of paths that are mutated by their vertices (Veach and Guibas 1997).
#pragma once

#include <array>
#include <cstdint>

#include "driftlight/film.h"
#include "driftlight/render.h"
#include "driftlight/small_step.h"
#include "path_mutation.h"

namespace driftlight {

/// Whether a mutation is bidirectional or a perturbation does not depend on the path, so each is in
/// detailed balance by itself: y is accepted with probability
///   min(1, f(y) T(x | y) / (f(x) T(y | x))).
class VeachChain {
 public:
  /// Starts at a path that carries light and is evaluated.
  VeachChain(const PathMutation& mutation, const MltOptions& options, Film& film,
             const VertexPath& start, Rng rng);

  /// Runs mutations, each splatting both paths with weights 1 - a and a.
  void run(std::uint64_t mutations);
  /// Deposits what the current path has gathered since it was entered.
  void flush();

  const LangevinStatistics& statistics() const { return statistics_; }

 private:
  VertexPath& current() { return paths_[current_]; }
  VertexPath& proposed() { return paths_[proposed_]; }
  /// The acceptance ratio of a bidirectional mutation to `proposed`.
  double propose_bidirectional();
  /// Delayed rejection (mutation_loop.h): a perturbation, and where it is refused a smaller one.
  void take_delayed_step();
  /// Moves with this probability to the path of this index; true if it moved.
  bool resolve(double acceptance, std::size_t& index);

  const PathMutation& mutation_;
  double bidirectional_probability_;
  DelayedRejection delayed_rejection_;
  Film& film_;
  Rng rng_;
  std::array<VertexPath, 3> paths_;
  std::size_t current_ = 0;
  std::size_t proposed_ = 1;
  std::size_t second_ = 2;
  double gathered_ = 0;  ///< weight of the current path not yet splatted
  LangevinStatistics statistics_;
};

}  // namespace driftlight
