// SPDX-License-Identifier: Apache-2.0
/// A Metropolis chain in primary sample space whose states are paths of one strategy each.
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <variant>

#include "driftlight/render.h"
#include "driftlight/running_mean.h"
#include "gaussian_step.h"
#include "strategy_target.h"

namespace driftlight {

using StrategyMethod = std::variant<MmltOptions, H2mcOptions, LmcOptions>;

const MmltOptions& common_options(const StrategyMethod& method);

/// The target is I_st(u) over numbers u and strategies (s, t). Mutations are large steps, which
/// draw all numbers anew; small ones of Kelemen et al. 2002; and steps at which the numbers that
/// steer the path move by a Gaussian, those that choose lobes and the emitter as in the former, and
/// the strategy remains. Which it is does not depend on the state.
///
/// With StrategyLargeSteps::One the strategy is a number like the others, among those of one
/// length; large and isotropic steps are symmetric. With All the strategy is drawn with the numbers
/// of a large step, in proportion to I_st: the proposal has the density I_st / I, I the sum over
/// all strategies, and is accepted with probability I(u') / I(u). All other steps keep it. The
/// chain then needs I at the point that it leaves, which it finds when it is asked for.
///
/// A Gaussian step from u to u' by the offset d is accepted with probability
/// I_st(u') N_u'(-d) / (I_st(u) N_u(d)).
class StrategyChain {
 public:
  /// Starts at numbers whose target is positive: I_st of their own strategy, or with All the sum.
  StrategyChain(const StrategyTarget& target, const StrategyMethod& method, Film& film,
                const StrategyNumbers& start, Rng rng);

  void run(std::uint64_t mutations);
  /// Deposits what the current point has gathered since it was entered.
  void flush() { deposits_.flush(); }

  const LangevinStatistics& statistics() const { return statistics_; }
  /// Of the numbers.
  int edges() const { return current_.numbers.edges(); }
  /// At all large steps proposed so far, independent estimates of the integral of the target.
  const RunningMean& weights() const { return weights_; }

 private:
  /// A point and what is known of it.
  struct Point {
    StrategyNumbers numbers;
    std::optional<PrimaryPath> path;  ///< if it carries light
    std::optional<double> all;        ///< I
    bool derived = false;             ///< the rest is known
    /// Of LMC; empty where it is not finite.
    Vector gradient;
    GaussianStep step;  ///< of H2MC

    const Strategy& strategy() const { return path->strategy; }
  };

  void mutate();
  double propose_large();
  double propose_isotropic();
  double propose_gaussian();
  /// Evaluates the proposed point at its numbers.
  void look(const Strategy& strategy);
  /// Draws one path out of a sample of the point's numbers, whose light is then `sample_`.
  void draw(Point& point, PrimaryPlace& place);
  void derive(Point& point);
  GaussianStep step_at(const Point& point) const;
  /// The chain stays at its point after a Gaussian step.
  void remember();

  StrategyTarget target_;
  const StrategyMethod& method_;
  const MmltOptions& options_;
  double isotropic_probability_;
  PrimaryDeposits deposits_;
  Rng rng_;
  Point current_;
  Point proposed_;
  PrimaryPlace sample_;  ///< the proposed one, of a large step
  PrimaryPlace here_;
  PrimaryDerivatives derivatives_;
  std::map<std::pair<int, int>, GradientMemory> memories_;  ///< of LMC, by strategy
  LangevinStatistics statistics_;
  RunningMean weights_;
};

}  // namespace driftlight
