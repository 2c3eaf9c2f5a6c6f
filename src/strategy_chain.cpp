// SPDX-License-Identifier: Apache-2.0
#include "strategy_chain.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <type_traits>

#include "mutation_loop.h"

namespace driftlight {
namespace {

double isotropic_probability(const StrategyMethod& method) {
  return std::visit(
      [](const auto& of) {
        if constexpr (std::is_base_of_v<GaussianStepOptions, std::decay_t<decltype(of)>>)
          return of.isotropic_probability;
        else
          return 1.0;
      },
      method);
}

/// Of a proposal with so much light, over that of the current point.
double ratio(double proposed, double current) { return proposed > 0.0 ? proposed / current : 0.0; }

}  // namespace

const MmltOptions& common_options(const StrategyMethod& method) {
  return std::visit([](const auto& of) -> const MmltOptions& { return of; }, method);
}

double acceptance_of(double ratio, Rejections& rejections) {
  if (std::isnan(ratio)) {
    ++rejections.non_finite;
    return 0.0;
  }
  return std::min(1.0, ratio);
}

StrategyChain::StrategyChain(const StrategyTarget& target, const StrategyMethod& method,
                             const GradientCache* cache, Film& film, const StrategyNumbers& start,
                             Rng rng)
    : target_(target),
      method_(method),
      options_(common_options(method)),
      cache_(cache),
      isotropic_probability_(isotropic_probability(method)),
      deposits_(film),
      rng_(rng),
      second_(options_) {
  second_.step_min *= options_.delayed_rejection.second_scale;
  second_.step_max *= options_.delayed_rejection.second_scale;
  current_.numbers = start;
  if (options_.large_steps == StrategyLargeSteps::All)
    draw(current_, deposits_.current);
  else
    current_.path = target_(start, start.strategy(), deposits_.current);
}

void StrategyChain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) mutate();
  statistics_.mutations += mutations;
}

void StrategyChain::mutate() {
  const bool large = rng_.uniform() < options_.large_step_probability;
  const bool isotropic = !large && rng_.uniform() < isotropic_probability_;
  if (!large && options_.delayed_rejection.on) return take_delayed_step(isotropic);
  const double acceptance_ratio = large       ? propose_large()
                                  : isotropic ? propose_isotropic()
                                              : propose_gaussian();
  const double acceptance = acceptance_of(acceptance_ratio, statistics_.rejections);
  statistics_.rejections.non_finite += target_.take_non_finite();
  KernelStatistics& kernel = large ? statistics_.large_step : statistics_.small_step;
  ++kernel.proposed;
  kernel.accepted += acceptance;
  const bool of_sample = large && options_.large_steps == StrategyLargeSteps::All;
  const bool accepted =
      of_sample ? deposits_.settle(sample_, acceptance, rng_) : deposits_.settle(acceptance, rng_);
  if (accepted)
    std::swap(current_, proposed_);
  else if (!large)
    ++(acceptance > 0.0 ? statistics_.rejections.hastings : statistics_.rejections.missed);
  if (!large && !isotropic) remember();
}

void StrategyChain::take_delayed_step(bool isotropic) {
  const double first =
      acceptance_of(isotropic ? propose_isotropic() : propose_gaussian(), statistics_.rejections);
  ++statistics_.small_step.proposed;
  statistics_.small_step.accepted += first;
  double acceptance = 1.0;
  if (!(rng_.uniform() < first)) {
    ++(first > 0.0 ? statistics_.rejections.hastings : statistics_.rejections.missed);
    acceptance = acceptance_of(propose_second(first, isotropic), statistics_.rejections);
    ++statistics_.second_step.proposed;
    statistics_.second_step.accepted += acceptance;
  }
  statistics_.rejections.non_finite += target_.take_non_finite();
  if (deposits_.settle(acceptance, rng_)) std::swap(current_, proposed_);
  if (!isotropic) remember();
}

double StrategyChain::propose_second(double first_acceptance, bool isotropic) {
  ghost_.numbers = proposed_.numbers;
  proposed_.numbers = current_.numbers;
  move(proposed_.numbers, second_);
  look(proposed_, strategy_of(proposed_.numbers), deposits_.proposed);
  if (!proposed_.path) return 0.0;
  ghost_.numbers.shift(current_.numbers, proposed_.numbers);
  look(ghost_, strategy_of(ghost_.numbers), ghost_place_);
  double log_there = 0.0;
  double log_ghost = 0.0;
  if (!isotropic) {
    derive(proposed_);
    log_there = log_density(proposed_, offset_);
    if (ghost_.path) {
      derive(ghost_);
      log_ghost = log_density(ghost_, -offset_);
    }
  }
  const double there = deposits_.proposed.target;
  double to_ghost = 0.0;
  if (ghost_.path)
    to_ghost = acceptance_of(std::exp(log_ghost - log_there) * ratio(ghost_place_.target, there),
                             statistics_.rejections);
  const double log_here = isotropic ? 0.0 : log_density_;
  return second_acceptance(std::exp(log_there - log_here) * there / deposits_.current.target,
                           first_acceptance, to_ghost);
}

double StrategyChain::propose_large() {
  proposed_.numbers = StrategyNumbers(edges(), current_.numbers.has_lens(), rng_);
  if (options_.large_steps == StrategyLargeSteps::One) {
    look(proposed_, proposed_.numbers.strategy(), deposits_.proposed);
    weights_.add((edges() + 1) * deposits_.proposed.target);
    return ratio(deposits_.proposed.target, deposits_.current.target);
  }
  draw(proposed_, deposits_.proposed);
  weights_.add(*proposed_.all);
  if (!proposed_.path) return 0.0;
  if (!current_.all) {
    target_.sample(current_.numbers, rng_, here_);
    current_.all = here_.target;
  }
  return ratio(*proposed_.all, *current_.all);
}

double StrategyChain::propose_isotropic() {
  proposed_.numbers = current_.numbers;
  move(proposed_.numbers, options_);
  look(proposed_, strategy_of(proposed_.numbers), deposits_.proposed);
  return ratio(deposits_.proposed.target, deposits_.current.target);
}

double StrategyChain::propose_gaussian() {
  derive(current_);
  std::tie(offset_, log_density_) = draw_offset();
  proposed_.numbers = current_.numbers;
  const Strategy& strategy = current_.strategy();
  proposed_.numbers.move_choices(strategy, options_, rng_);
  for (int i = 0; i < offset_.size(); ++i) {
    double& u = proposed_.numbers.steering(strategy, i);
    u = wrapped(u + offset_[i]);
  }
  look(proposed_, strategy, deposits_.proposed);
  if (!proposed_.path) return 0.0;
  derive(proposed_);
  const double log_ratio = log_density(proposed_, -offset_) - log_density_;
  return std::exp(log_ratio) * ratio(deposits_.proposed.target, deposits_.current.target);
}

void StrategyChain::look(Point& point, const Strategy& strategy, PrimaryPlace& place) {
  point.path = target_(point.numbers, strategy, place);
  point.all.reset();
  point.derived = false;
}

Strategy StrategyChain::strategy_of(const StrategyNumbers& numbers) const {
  return options_.large_steps == StrategyLargeSteps::One ? numbers.strategy() : current_.strategy();
}

void StrategyChain::move(StrategyNumbers& numbers, const PrimaryOptions& sizes) {
  if (options_.large_steps == StrategyLargeSteps::One)
    numbers.move(sizes, rng_);
  else
    numbers.move_within(current_.strategy(), sizes, rng_);
}

void StrategyChain::draw(Point& point, PrimaryPlace& place) {
  const auto choice = target_.sample(point.numbers, rng_, sample_);
  point.all = sample_.target;
  point.derived = false;
  point.path.reset();
  place.splats.clear();
  place.target = 0.0;
  if (!choice) return;
  point.path = choice->path;
  place.splats.push_back(sample_.splats[choice->splat]);
  place.target = place.splats.front().luminance;
}

void StrategyChain::derive(Point& point) {
  if (point.derived) return;
  point.derived = true;
  if (cache_ != nullptr) {
    point.step = cache_->step(point.strategy(), steering(point));
    return;
  }
  if (const auto* h2mc = std::get_if<H2mcOptions>(&method_)) {
    const bool finite =
        target_.function().gradient_and_hessian(point.numbers, *point.path, derivatives_);
    const int d = point.numbers.dimension(point.strategy());
    point.step =
        finite ? GaussianStep::hamiltonian(derivatives_.gradient, derivatives_.hessian, h2mc->sigma)
               : GaussianStep::isotropic(d, h2mc->sigma);
    return;
  }
  if (const auto* mala = std::get_if<MalaOptions>(&method_)) {
    point.langevin = langevin_step(point, mala->kernel);
    return;
  }
  const bool finite = target_.function().gradient(point.numbers, *point.path, derivatives_);
  point.gradient.resize(0);
  if (finite)
    point.gradient = GradientMemory::bounded(derivatives_.gradient, std::get<LmcOptions>(method_));
}

/// Q = 1/9 sum_k w_k J_k^T J_k + (trust / 2)^-2 I: a number is on a circle of circumference 1, and
/// half of it is to it what pi is to a direction in (E63.13).
StepDistribution StrategyChain::langevin_step(const Point& point, const KernelOptions& kernel) {
  const int d = point.numbers.dimension(point.strategy());
  const bool constrained = kernel.preconditioner != PreconditionerKind::Identity;
  const PrimaryFunction& function = target_.function();
  const bool finite =
      constrained ? function.gradient_and_constraints(point.numbers, *point.path, derivatives_)
                  : function.gradient(point.numbers, *point.path, derivatives_);
  Factor factor = IdentityFactor(d);
  if (constrained) {
    Matrix q = Matrix::Zero(d, d);
    if (finite && kernel.preconditioner == PreconditionerKind::Constraints)
      q = derivatives_.constraints;
    else if (finite)
      q.diagonal() = derivatives_.constraints.diagonal();
    q.diagonal().array() += 4.0 / (kernel.trust * kernel.trust);
    if (const auto cholesky = CholeskyFactor::of(q)) factor = *cholesky;
  }
  const Vector slope = -derivatives_.gradient;
  const bool drifts = finite && kernel.drift != Drift::None;
  return {kernel, d, factor, drifts ? &slope : nullptr, nullptr};
}

Vector StrategyChain::steering(const Point& point) const {
  Vector numbers(point.numbers.dimension(point.strategy()));
  for (int i = 0; i < numbers.size(); ++i) numbers[i] = point.numbers.steering(point.strategy(), i);
  return numbers;
}

GaussianStep StrategyChain::step_at(const Point& point) const {
  const auto* lmc = std::get_if<LmcOptions>(&method_);
  if (lmc == nullptr || cache_ != nullptr) return point.step;
  const auto [s, t] = point.strategy();
  if (point.gradient.size() == 0)
    return GaussianStep::isotropic(point.numbers.dimension(point.strategy()), lmc->sigma);
  const auto memory = memories_.find({s, t});
  return (memory != memories_.end() ? memory->second : GradientMemory())
      .moments(point.gradient, *lmc)
      .step(*lmc);
}

std::pair<Vector, double> StrategyChain::draw_offset() {
  if (const auto* mala = std::get_if<MalaOptions>(&method_)) {
    scale_ = draw_scale(mala->kernel, rng_);
    const Vector offset = current_.langevin.sample(scale_, rng_);
    return {offset, current_.langevin.log_density(offset, scale_)};
  }
  const GaussianStep step = step_at(current_);
  const Vector offset = step.sample(rng_);
  return {offset, step.log_density(offset)};
}

double StrategyChain::log_density(const Point& point, const Vector& offset) const {
  if (std::holds_alternative<MalaOptions>(method_))
    return point.langevin.log_density(offset, scale_);
  return step_at(point).log_density(offset);
}

void StrategyChain::remember() {
  const auto* lmc = std::get_if<LmcOptions>(&method_);
  if (lmc == nullptr || current_.gradient.size() == 0) return;
  const auto [s, t] = current_.strategy();
  GradientMemory& memory = memories_[{s, t}];
  memory.add(current_.gradient, *lmc);
  if (record_ != nullptr)
    record_->push_back(
        {current_.strategy(), steering(current_), memory.moments(current_.gradient, *lmc)});
}

}  // namespace driftlight
