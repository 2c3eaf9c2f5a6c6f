// SPDX-License-Identifier: Apache-2.0
#include "strategy_chain.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

double isotropic_probability(const StrategyMethod& method) {
  if (std::holds_alternative<MmltOptions>(method)) return 1.0;
  if (const auto* h2mc = std::get_if<H2mcOptions>(&method)) return h2mc->isotropic_probability;
  return std::get<LmcOptions>(method).isotropic_probability;
}

/// Of a proposal with so much light, over that of the current point.
double ratio(double proposed, double current) { return proposed > 0.0 ? proposed / current : 0.0; }

}  // namespace

const MmltOptions& common_options(const StrategyMethod& method) {
  return std::visit([](const auto& of) -> const MmltOptions& { return of; }, method);
}

StrategyChain::StrategyChain(const StrategyTarget& target, const StrategyMethod& method, Film& film,
                             const StrategyNumbers& start, Rng rng)
    : target_(target),
      method_(method),
      options_(common_options(method)),
      isotropic_probability_(isotropic_probability(method)),
      deposits_(film),
      rng_(rng) {
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
  const double acceptance = std::min(1.0, large       ? propose_large()
                                          : isotropic ? propose_isotropic()
                                                      : propose_gaussian());
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

double StrategyChain::propose_large() {
  proposed_.numbers = StrategyNumbers(edges(), current_.numbers.has_lens(), rng_);
  if (options_.large_steps == StrategyLargeSteps::One) {
    look(proposed_.numbers.strategy());
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
  if (options_.large_steps == StrategyLargeSteps::One) {
    proposed_.numbers.move(options_, rng_);
    look(proposed_.numbers.strategy());
  } else {
    proposed_.numbers.move_within(current_.strategy(), options_, rng_);
    look(current_.strategy());
  }
  return ratio(deposits_.proposed.target, deposits_.current.target);
}

double StrategyChain::propose_gaussian() {
  derive(current_);
  const GaussianStep forward = step_at(current_);
  const Vector offset = forward.sample(rng_);
  proposed_.numbers = current_.numbers;
  const Strategy& strategy = current_.strategy();
  proposed_.numbers.move_choices(strategy, options_, rng_);
  for (int i = 0; i < offset.size(); ++i) {
    double& u = proposed_.numbers.steering(strategy, i);
    u = wrapped(u + offset[i]);
  }
  look(strategy);
  if (!proposed_.path) return 0.0;
  derive(proposed_);
  const double log_ratio = step_at(proposed_).log_density(-offset) - forward.log_density(offset);
  return std::exp(log_ratio) * ratio(deposits_.proposed.target, deposits_.current.target);
}

void StrategyChain::look(const Strategy& strategy) {
  proposed_.path = target_(proposed_.numbers, strategy, deposits_.proposed);
  proposed_.all.reset();
  proposed_.derived = false;
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
  if (const auto* h2mc = std::get_if<H2mcOptions>(&method_)) {
    const bool finite =
        target_.function().gradient_and_hessian(point.numbers, *point.path, derivatives_);
    const int d = point.numbers.dimension(point.strategy());
    point.step =
        finite ? GaussianStep::hamiltonian(derivatives_.gradient, derivatives_.hessian, h2mc->sigma)
               : GaussianStep::isotropic(d, h2mc->sigma);
    return;
  }
  const bool finite = target_.function().gradient(point.numbers, *point.path, derivatives_);
  point.gradient.resize(0);
  if (finite)
    point.gradient = GradientMemory::bounded(derivatives_.gradient, std::get<LmcOptions>(method_));
}

GaussianStep StrategyChain::step_at(const Point& point) const {
  const auto* lmc = std::get_if<LmcOptions>(&method_);
  if (lmc == nullptr) return point.step;
  const auto [s, t] = point.strategy();
  if (point.gradient.size() == 0)
    return GaussianStep::isotropic(point.numbers.dimension(point.strategy()), lmc->sigma);
  const auto memory = memories_.find({s, t});
  return (memory != memories_.end() ? memory->second : GradientMemory()).step(point.gradient, *lmc);
}

void StrategyChain::remember() {
  const auto* lmc = std::get_if<LmcOptions>(&method_);
  if (lmc == nullptr || current_.gradient.size() == 0) return;
  const auto [s, t] = current_.strategy();
  memories_[{s, t}].add(current_.gradient, *lmc);
}

}  // namespace driftlight
