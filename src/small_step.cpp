// SPDX-License-Identifier: Apache-2.0
#include "driftlight/small_step.h"

#include <algorithm>
#include <cmath>

#include "driftlight/aperture.h"
#include "driftlight/divergence.h"
#include "driftlight/precision.h"

namespace driftlight {
namespace {

/// Traces and evaluates the coordinates of `to` as a path like `from`; counts why it fails.
bool evaluate(const Scene& scene, const ChainState& from, ChainState& to, Rejections& rejections) {
  if (!succeeded(trace(scene, from.topology, to.coordinates, to.topology), rejections))
    return false;
  to.has_step = false;
  to.log_weight = std::numeric_limits<double>::quiet_NaN();
  to.contribution = contribution(scene, to.topology, to.coordinates);
  if (std::isfinite(to.contribution.log_target)) return true;
  // log f = -infinity is a path without light, as a missed one; all else is a numerical failure.
  if (to.contribution.log_target == -std::numeric_limits<double>::infinity())
    ++rejections.missed;
  else
    ++rejections.non_finite;
  return false;
}

}  // namespace

bool succeeded(TraceStatus status, Rejections& rejections) {
  switch (status) {
    case TraceStatus::Ok:
      return true;
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
  return false;
}

namespace {

/// -infinity if anything is NaN.
double log_acceptance_ratio(double log_target_from, double log_target_to, double log_pdf_forward,
                            double log_pdf_reverse) {
  const double log_ratio = log_target_to - log_target_from + log_pdf_reverse - log_pdf_forward;
  return std::isnan(log_ratio) ? -std::numeric_limits<double>::infinity() : log_ratio;
}

}  // namespace

double acceptance_ratio(double log_target_from, double log_target_to, double log_pdf_forward,
                        double log_pdf_reverse) {
  return std::exp(
      log_acceptance_ratio(log_target_from, log_target_to, log_pdf_forward, log_pdf_reverse));
}

double log_acceptance(double log_target_from, double log_target_to, double log_pdf_forward,
                      double log_pdf_reverse) {
  return std::min(
      0.0, log_acceptance_ratio(log_target_from, log_target_to, log_pdf_forward, log_pdf_reverse));
}

double log_refused(double log_pdf, double log_first_acceptance) {
  return log_pdf + std::log(-std::expm1(log_first_acceptance));
}

void prepare_step(const Scene& scene, const KernelOptions& options, ChainState& state) {
  using enum PreconditionerKind;
  const PreconditionerKind kind = options.preconditioner;
  const DerivativeRequest request{.gradient = options.drift != Drift::None,
                                  .constraints = kind == Constraints || kind == Diagonal};
  state.chart = Chart(scene, state.topology, state.coordinates);
  state.has_step = true;
  state.figures.reset();
  const double floor = kConstraintFloor / (options.trust * options.trust);
  Linearization path;
  path.floor = floor;
  linearize(scene, state.topology, state.chart, options.derivatives, request, path);
  Apertures apertures;
  if (options.aperture && request.constraints) {
    apertures = find_apertures(scene, state.topology, state.coordinates);
    constrain(scene, state.topology, state.chart, apertures, path);
  }
  std::optional<Matrix> precision;
  if (kind == Diagonal) precision = diagonal_precision(path);
  if (kind == Hessian)
    precision = hessian_precision(scene, state.topology, state.chart,
                                  Vector::Zero(state.chart.dimension()), floor);
  std::optional<Vector> div;
  if (options.drift == Drift::Full && kind != Identity) {
    div = kind == Constraints ? divergence(scene, state.topology, state.chart, options.derivatives,
                                           apertures, floor)
                              : dense_divergence(scene, state.topology, state.chart, kind, floor);
    if (!div->allFinite()) div.reset();
  }
  state.finite =
      state.step.assign(options, path, precision ? &*precision : nullptr, div ? &*div : nullptr);
}

void SmallStep::prepare(ChainState& state) {
  prepare_step(scene_, options_, state);
  if (probe_ != nullptr) probe_->visit(state.topology, state.coordinates);
}

bool SmallStep::propose(ChainState& from, ChainState& to, Rng& rng, Rejections& rejections) {
  if (!from.has_step) prepare(from);
  if (!from.finite) {
    ++rejections.non_finite;
    return false;
  }
  scale_ = first_scale_ = draw_scale(options_, rng);
  return step(from, to, rng, rejections);
}

bool SmallStep::propose_again(ChainState& from, ChainState& to, Rng& rng, Rejections& rejections) {
  if (!from.finite) return false;  // counted before
  scale_ = *second_scale_ * first_scale_;
  return step(from, to, rng, rejections);
}

bool SmallStep::step(ChainState& from, ChainState& to, Rng& rng, Rejections& rejections) {
  const Vector delta = from.step.sample(scale_, rng);
  if (!delta.allFinite()) {
    ++rejections.non_finite;
    return false;
  }
  to.coordinates = from.chart.retract(delta);
  return evaluate(scene_, from, to, rejections);
}

std::optional<LogDensities> SmallStep::log_densities(ChainState& from, ChainState& to,
                                                     Rejections& rejections) {
  prepare(to);
  if (!to.finite) {
    ++rejections.non_finite;
    return std::nullopt;
  }
  const auto there = from.chart.inverse(to.coordinates);
  const auto back = to.chart.inverse(from.coordinates);
  if (!there || !back) return std::nullopt;
  // `there->delta` is delta up to rounding; taking it from the coordinates keeps the two densities
  // on one footing.
  const double forward = from.step.log_density(there->delta, scale_) + there->log_jacobian;
  const double reverse = to.step.log_density(back->delta, scale_) + back->log_jacobian;
  if (!std::isfinite(forward) || !std::isfinite(reverse)) {
    ++rejections.non_finite;
    return std::nullopt;
  }
  return LogDensities{forward, reverse};
}

double SmallStep::log_first_density(const ChainState& from, const PathCoordinates& to) const {
  const auto there = from.chart.inverse(to);
  if (!there) return -std::numeric_limits<double>::infinity();
  return from.step.log_density(there->delta, first_scale_) + there->log_jacobian;
}

void SmallStep::record(ChainState& from, double acceptance, StepLayers& layers) const {
  const Vec2d& film = from.contribution.film;
  if (!from.finite) {
    layers.add(film, acceptance, nullptr, 0.0);
    return;
  }
  if (!from.figures)
    from.figures = step_figures(scene_, from.topology, from.chart, options_.derivatives, from.step);
  layers.add(film, acceptance, &*from.figures, from.step.time_step(scale_));
}

}  // namespace driftlight
