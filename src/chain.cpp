// SPDX-License-Identifier: Apache-2.0
#include "driftlight/chain.h"

#include <algorithm>
#include <cmath>

#include "driftlight/divergence.h"

namespace driftlight {

double log_acceptance(double log_target_from, double log_target_to, double log_pdf_forward,
                      double log_pdf_reverse) {
  const double log_ratio = log_target_to - log_target_from + log_pdf_reverse - log_pdf_forward;
  return std::isnan(log_ratio) ? -std::numeric_limits<double>::infinity()
                               : std::min(0.0, log_ratio);
}

void prepare_step(const Scene& scene, const KernelOptions& options, ChainState& state) {
  const DerivativeRequest request{
      .gradient = options.drift != Drift::None,
      .constraints = options.preconditioner == PreconditionerKind::Constraints};
  state.chart = Chart(scene, state.topology, state.coordinates);
  state.has_step = true;
  state.figures.reset();
  Linearization path;
  linearize(scene, state.topology, state.chart, options.derivatives, request, path);
  std::optional<Vector> div;
  if (options.drift == Drift::Full && request.constraints) {
    div = divergence(scene, state.topology, state.chart, options.derivatives);
    if (!div->allFinite()) div.reset();
  }
  state.finite = state.step.assign(options, path, div ? &*div : nullptr);
}

Chain::Chain(const Scene& scene, const PathSampler& sampler, const LangevinOptions& options,
             Film& film, const PathSampler::Sample& start, Rng rng, StepLayers* layers)
    : scene_(scene), sampler_(sampler), options_(options), film_(film), rng_(rng), layers_(layers) {
  current().topology = start.topology;
  current().coordinates = start.coordinates;
  current().contribution = contribution(scene, start.topology, start.coordinates);
}

void Chain::run(std::uint64_t mutations) {
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const bool large = rng_.uniform() < options_.large_step_probability;
    KernelStatistics& kernel = large ? statistics_.large_step : statistics_.small_step;
    const std::optional<double> acceptance = large ? propose_large() : propose_small();
    ++kernel.proposed;
    kernel.accepted += acceptance.value_or(0.0);
    if (layers_ != nullptr && !large) record_step(acceptance.value_or(0.0));
    const bool moved = resolve(acceptance.value_or(0.0));
    if (acceptance && !moved && !large) ++statistics_.rejections.hastings;
  }
  statistics_.mutations += mutations;
}

/// acceptance = min(1, w(y) / w(x)), w = f / q
std::optional<double> Chain::propose_large() {
  const auto sample = sampler_.sample(rng_);
  double log_weight = -std::numeric_limits<double>::infinity();
  ChainState& to = proposed();
  if (sample) {
    to.topology = sample->topology;
    to.coordinates = sample->coordinates;
    to.contribution = contribution(scene_, to.topology, to.coordinates);
    log_weight = to.contribution.log_target - sampler_.log_density(to.topology, to.coordinates);
    to.has_step = false;
    to.log_weight = log_weight;
  }
  const double weight = std::exp(log_weight);
  if (!std::isfinite(weight)) {
    ++statistics_.rejections.non_finite;
    weights_.add(0.0);
    return std::nullopt;
  }
  weights_.add(weight);
  if (weight == 0.0) return std::nullopt;
  ChainState& from = current();
  if (std::isnan(from.log_weight))
    from.log_weight =
        from.contribution.log_target - sampler_.log_density(from.topology, from.coordinates);
  return std::exp(log_acceptance(from.log_weight, to.log_weight, 0.0, 0.0));
}

std::optional<double> Chain::propose_small() {
  ChainState& from = current();
  ChainState& to = proposed();
  const KernelOptions& options = options_.kernel;
  if (!from.has_step) prepare(from);
  if (!from.finite) {
    ++statistics_.rejections.non_finite;
    return std::nullopt;
  }
  const double scale = draw_scale(options, rng_);
  scale_ = scale;
  const Vector delta = from.step.sample(scale, rng_);
  if (!delta.allFinite()) {
    ++statistics_.rejections.non_finite;
    return std::nullopt;
  }
  to.coordinates = from.chart.retract(delta);
  if (!evaluate_proposed()) return std::nullopt;
  prepare(to);
  if (!to.finite) {
    ++statistics_.rejections.non_finite;
    return std::nullopt;
  }
  const auto there = from.chart.inverse(to.coordinates);
  const auto back = to.chart.inverse(from.coordinates);
  if (!there || !back) return std::nullopt;
  // `there->delta` is delta up to rounding; taking it from the coordinates keeps the two densities
  // on one footing.
  const double forward = from.step.log_density(there->delta, scale) + there->log_jacobian;
  const double reverse = to.step.log_density(back->delta, scale) + back->log_jacobian;
  if (!std::isfinite(forward) || !std::isfinite(reverse)) {
    ++statistics_.rejections.non_finite;
    return std::nullopt;
  }
  return std::exp(
      log_acceptance(from.contribution.log_target, to.contribution.log_target, forward, reverse));
}

void Chain::prepare(ChainState& state) {
  prepare_step(scene_, options_.kernel, state);
  if (probe_ != nullptr) probe_->visit(state.topology, state.coordinates);
}

bool Chain::evaluate_proposed() {
  ChainState& to = proposed();
  Rejections& rejections = statistics_.rejections;
  switch (trace(scene_, current().topology, to.coordinates, to.topology)) {
    case TraceStatus::Ok:
      break;
    case TraceStatus::Missed:
      ++rejections.missed;
      return false;
    case TraceStatus::OtherLobe:
      ++rejections.other_lobe;
      return false;
    case TraceStatus::Occluded:
      ++rejections.occluded;
      return false;
  }
  to.has_step = false;
  to.log_weight = std::numeric_limits<double>::quiet_NaN();
  to.contribution = contribution(scene_, to.topology, to.coordinates);
  if (std::isfinite(to.contribution.log_target)) return true;
  // log f = -infinity is a path without light, as a missed one; all else is a numerical failure.
  if (to.contribution.log_target == -std::numeric_limits<double>::infinity())
    ++rejections.missed;
  else
    ++rejections.non_finite;
  return false;
}

void Chain::record_step(double acceptance) {
  ChainState& from = current();
  const Vec2d film = scene_.camera().film_position(from.coordinates(0));
  if (!from.finite) {
    layers_->add(film, acceptance, nullptr, 0.0);
    return;
  }
  if (!from.figures)
    from.figures =
        step_figures(scene_, from.topology, from.chart, options_.kernel.derivatives, from.step);
  layers_->add(film, acceptance, &*from.figures, from.step.time_step(scale_));
}

bool Chain::resolve(double acceptance) {
  ++statistics_.path_length[static_cast<std::size_t>(current().topology.length())];
  gathered_ += 1.0 - acceptance;
  const bool accept = rng_.uniform() < acceptance;
  if (accept) {
    flush();
    current_ = 1 - current_;
    gathered_ = acceptance;
  } else if (acceptance > 0.0) {
    const ChainState& to = proposed();
    film_.splat(scene_.camera().film_position(to.coordinates(0)), to.contribution.color,
                acceptance);
  }
  return accept;
}

void Chain::flush() {
  if (gathered_ > 0.0)
    film_.splat(scene_.camera().film_position(current().coordinates(0)),
                current().contribution.color, gathered_);
  gathered_ = 0.0;
}

}  // namespace driftlight
