// SPDX-License-Identifier: Apache-2.0
/// Checks the derivatives that a chain uses, at a random sample of its states.
#pragma once

#include <vector>

#include "driftlight/gradient_table.h"
#include "driftlight/options.h"
#include "driftlight/random.h"

namespace driftlight {

/// Looks at the states of one chain: the first one, or the one after so many, then about one in a
/// thousand, 32 at most. It changes nothing of the chain and has random numbers of its own.
class GradientProbe {
 public:
  /// Checks what a kernel with these options uses: the gradient if there is a drift, the residual
  /// Jacobians if they precondition it, the divergence if it is part of the drift, and derivatives
  /// by hand if the method is.
  GradientProbe(const Scene& scene, const KernelOptions& options, std::uint64_t seed,
                std::uint64_t chain, std::uint64_t skip = 0);

  /// To be called with each state whose step has been prepared. States that carry no light count
  /// for nothing.
  void visit(const PathTopology& topology, const PathCoordinates& coordinates);

  /// In the order in which they came.
  const std::vector<CheckedPath>& paths() const { return paths_; }

 private:
  const Scene& scene_;
  CheckSelection selection_;
  DerivativeFunctions functions_;
  Rng rng_;
  std::uint64_t first_index_;
  double wait_;  ///< states to let pass before the next check
  std::vector<CheckedPath> paths_;
};

}  // namespace driftlight
