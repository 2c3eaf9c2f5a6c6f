// SPDX-License-Identifier: Apache-2.0
#include "gaussian_chain.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace driftlight {
namespace {

const GaussianStepOptions& common(const GaussianMethod& method) {
  return std::visit([](const auto& of) -> const GaussianStepOptions& { return of; }, method);
}

}  // namespace

GaussianChain::GaussianChain(const StrategyTarget& target, const GaussianMethod& method, Film& film,
                             const StrategyNumbers& start, Rng rng)
    : target_(target), method_(method), options_(common(method)), deposits_(film), rng_(rng) {
  current_.numbers = start;
  current_.path = target_(start, deposits_.current);
}

void GaussianChain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) mutate();
  statistics_.mutations += mutations;
}

void GaussianChain::mutate() {
  const bool large = rng_.uniform() < options_.large_step_probability;
  const bool isotropic = !large && rng_.uniform() < options_.isotropic_probability;
  double log_ratio = 0.0;
  double proposed = 0.0;
  if (large || isotropic) {
    if (large)
      proposed_.numbers = StrategyNumbers(edges(), rng_);
    else
      (proposed_.numbers = current_.numbers).move(options_, rng_);
    proposed = look();
    if (large) weights_.add(proposed);
  } else {
    derive(current_);
    const GaussianStep forward = step_at(current_);
    const Vector offset = forward.sample(rng_);
    proposed_.numbers = current_.numbers;
    const Strategy& strategy = current_.path->strategy;
    proposed_.numbers.move_choices(strategy, options_, rng_);
    for (int i = 0; i < offset.size(); ++i) {
      double& u = proposed_.numbers.steering(strategy, i);
      u = wrapped(u + offset[i]);
    }
    proposed = look();
    if (proposed > 0.0) {
      derive(proposed_);
      log_ratio = step_at(proposed_).log_density(-offset) - forward.log_density(offset);
    }
  }
  const double ratio =
      proposed > 0.0 ? std::exp(log_ratio) * proposed / deposits_.current.target : 0.0;
  const double acceptance = std::min(1.0, ratio);
  KernelStatistics& kernel = large ? statistics_.large_step : statistics_.small_step;
  ++kernel.proposed;
  kernel.accepted += acceptance;
  if (deposits_.settle(acceptance, rng_)) {
    std::swap(current_, proposed_);
  } else if (!large) {
    ++(proposed > 0.0 ? statistics_.rejections.hastings : statistics_.rejections.missed);
  }
  if (!large && !isotropic) remember();
}

double GaussianChain::look() {
  proposed_.path = target_(proposed_.numbers, deposits_.proposed);
  proposed_.derived = false;
  statistics_.rejections.non_finite += target_.take_non_finite();
  return deposits_.proposed.target;
}

void GaussianChain::derive(Point& point) {
  if (point.derived) return;
  point.derived = true;
  const int d = StrategyNumbers::dimension(edges());
  if (const auto* h2mc = std::get_if<H2mcOptions>(&method_)) {
    const bool finite =
        target_.function().gradient_and_hessian(point.numbers, *point.path, derivatives_);
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

GaussianStep GaussianChain::step_at(const Point& point) const {
  const auto* lmc = std::get_if<LmcOptions>(&method_);
  if (lmc == nullptr) return point.step;
  if (point.gradient.size() == 0)
    return GaussianStep::isotropic(StrategyNumbers::dimension(edges()), lmc->sigma);
  return memories_[static_cast<std::size_t>(point.path->strategy.s)].step(point.gradient, *lmc);
}

void GaussianChain::remember() {
  const auto* lmc = std::get_if<LmcOptions>(&method_);
  if (lmc == nullptr || current_.gradient.size() == 0) return;
  memories_[static_cast<std::size_t>(current_.path->strategy.s)].add(current_.gradient, *lmc);
}

}  // namespace driftlight
