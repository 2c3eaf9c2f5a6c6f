// SPDX-License-Identifier: Apache-2.0
/// A Metropolis chain in primary sample space whose states are paths of one strategy each.
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <variant>

#include "driftlight/kernel.h"
#include "driftlight/render.h"
#include "driftlight/running_mean.h"
#include "gaussian_step.h"
#include "gradient_cache.h"
#include "strategy_target.h"

namespace driftlight {

using StrategyMethod = std::variant<MmltOptions, H2mcOptions, LmcOptions, MalaOptions>;

const MmltOptions& common_options(const StrategyMethod& method);

/// min(1, ratio); 0 for a ratio that is not a number, which is counted.
double acceptance_of(double ratio, Rejections& rejections);

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
///
/// With delayed rejection a small step from u by d that is rejected is followed by an isotropic one
/// by e (Green and Mira 2001, in Rioux-Lavoie et al. 2020). From u + e the same steps lead back: by
/// d to a ghost u + e + d, and by -e. So the second step is accepted with probability
///   I_st(u + e) N_(u + e)(d) (1 - a_(u + e)(d)) / (I_st(u) N_u(d) (1 - a_u(d))),
/// a_u(d) the probability of accepting the first step by d at u; N = 1 of an isotropic one.
class StrategyChain {
 public:
  /// Starts at numbers whose target is positive: I_st of their own strategy, or with All the sum.
  /// Of LMC, steps are those of the cache unless it is null. References must outlive the chain.
  StrategyChain(const StrategyTarget& target, const StrategyMethod& method,
                const GradientCache* cache, Film& film, const StrategyNumbers& start, Rng rng);

  void run(std::uint64_t mutations);
  /// From here on LMC without a cache appends what it knows at the points where it has gone.
  void record(std::vector<GradientCache::Point>& points) { record_ = &points; }
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
    GaussianStep step;          ///< of H2MC, or by the cache
    StepDistribution langevin;  ///< of MALA

    const Strategy& strategy() const { return path->strategy; }
  };

  void mutate();
  void take_delayed_step(bool isotropic);
  double propose_second(double first_acceptance, bool isotropic);
  double propose_large();
  double propose_isotropic();
  double propose_gaussian();
  /// Evaluates a point at its numbers.
  void look(Point& point, const Strategy& strategy, PrimaryPlace& place);
  /// Of a small step, to these numbers.
  Strategy strategy_of(const StrategyNumbers& numbers) const;
  void move(StrategyNumbers& numbers, const PrimaryOptions& sizes);
  /// Draws one path out of a sample of the point's numbers, whose light is then `sample_`.
  void draw(Point& point, PrimaryPlace& place);
  void derive(Point& point);
  StepDistribution langevin_step(const Point& point, const KernelOptions& kernel);
  Vector steering(const Point& point) const;
  GaussianStep step_at(const Point& point) const;
  /// The offset of a Gaussian step from the current point, and its log density.
  std::pair<Vector, double> draw_offset();
  /// Of that step, or of the last one of its scale, at a point.
  double log_density(const Point& point, const Vector& offset) const;
  /// The chain stays at its point after a Gaussian step.
  void remember();

  StrategyTarget target_;
  const StrategyMethod& method_;
  const MmltOptions& options_;
  const GradientCache* cache_;
  std::vector<GradientCache::Point>* record_ = nullptr;
  double isotropic_probability_;
  PrimaryDeposits deposits_;
  Rng rng_;
  Point current_;
  Point proposed_;
  Vector offset_;  ///< of the last Gaussian step, and its density
  double log_density_ = 0;
  double scale_ = 1;       ///< of MALA's
  PrimaryOptions second_;  ///< sizes of second steps
  Point ghost_;
  PrimaryPlace ghost_place_;
  PrimaryPlace sample_;  ///< the proposed one, of a large step
  PrimaryPlace here_;
  PrimaryDerivatives derivatives_;
  std::map<std::pair<int, int>, GradientMemory> memories_;  ///< of LMC, by strategy
  LangevinStatistics statistics_;
  RunningMean weights_;
};

}  // namespace driftlight
