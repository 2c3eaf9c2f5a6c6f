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

/// Which mutation it is does not depend on the path, but that one without a caustic perturbation is
/// perturbed from the sensor instead; and perturbations keep what this depends on. So each kind is
/// in detailed balance by itself: y is accepted with probability
///   min(1, f(y) T(x | y) / (f(x) T(y | x))).
class VeachChain {
 public:
  /// Starts at a path that carries light and is evaluated.
  VeachChain(const PathMutation& mutation, double bidirectional_probability, Film& film,
             const VertexPath& start, Rng rng);

  /// Runs mutations, each splatting both paths with weights 1 - a and a.
  void run(std::uint64_t mutations);
  /// Deposits what the current path has gathered since it was entered.
  void flush();

  const LangevinStatistics& statistics() const { return statistics_; }

 private:
  const PathMutation& mutation_;
  double bidirectional_probability_;
  Film& film_;
  Rng rng_;
  std::array<VertexPath, 2> paths_;
  std::size_t current_ = 0;
  double gathered_ = 0;  ///< weight of the current path not yet splatted
  LangevinStatistics statistics_;
};

/// Proposes one of the perturbations of x, the two equally likely where it has both, and returns
/// the probability of acceptance; what makes it fail is counted.
double perturb(const PathMutation& mutation, const VertexPath& x, VertexPath& y, Rng& rng,
               Rejections& rejections);

}  // namespace driftlight
