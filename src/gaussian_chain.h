// SPDX-License-Identifier: Apache-2.0
/// A Metropolis chain in primary sample space whose small steps are Gaussians from derivatives.
#pragma once

#include <array>
#include <variant>

#include "driftlight/render.h"
#include "driftlight/running_mean.h"
#include "gaussian_step.h"
#include "strategy_target.h"

namespace driftlight {

using GaussianMethod = std::variant<H2mcOptions, LmcOptions>;

/// Mutations are large steps, which draw all numbers anew; small ones of Kelemen et al. 2002, which
/// move all of them; and steps at which the numbers that steer the path move by a Gaussian, those
/// that choose lobes and the emitter as in the former, and the strategy remains. Which it is does
/// not depend on the state. The first two are symmetric; a Gaussian one from u to u' by the offset
/// d is accepted with probability I(u') N_u'(-d) / (I(u) N_u(d)).
class GaussianChain {
 public:
  /// Starts at a point that carries light.
  GaussianChain(const StrategyTarget& target, const GaussianMethod& method, Film& film,
                const StrategyNumbers& start, Rng rng);

  void run(std::uint64_t mutations);
  /// Deposits what the current point has gathered since it was entered.
  void flush() { deposits_.flush(); }

  const LangevinStatistics& statistics() const { return statistics_; }
  int edges() const { return current_.numbers.edges(); }
  /// I at all large steps proposed so far: independent estimates of its integral.
  const RunningMean& weights() const { return weights_; }

 private:
  /// A point and what is known of it.
  struct Point {
    StrategyNumbers numbers;
    std::optional<PrimaryPath> path;  ///< if it carries light
    bool derived = false;             ///< the rest is known
    /// Of LMC; empty where it is not finite.
    Vector gradient;
    GaussianStep step;  ///< of H2MC
  };

  void mutate();
  /// Evaluates the proposed point. Its target.
  double look();
  void derive(Point& point);
  GaussianStep step_at(const Point& point) const;
  /// The chain stays at its point after a Gaussian step.
  void remember();

  StrategyTarget target_;
  const GaussianMethod& method_;
  const GaussianStepOptions& options_;
  PrimaryDeposits deposits_;
  Rng rng_;
  Point current_;
  Point proposed_;
  PrimaryDerivatives derivatives_;
  std::array<GradientMemory, kMaxPathLength + 1> memories_;  ///< of LMC, by strategy
  LangevinStatistics statistics_;
  RunningMean weights_;
};

}  // namespace driftlight
