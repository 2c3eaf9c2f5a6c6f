// SPDX-License-Identifier: Apache-2.0
#include "derivative_judge.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace driftlight {
namespace {

/// First steps of Ridders' method, in widths: the wide one drowns rounding, the small ones see past
/// a kink close by and fit into what is left before an edge.
constexpr std::array<double, 7> kSteps{1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7};
/// The index of the one that is nearly always enough.
constexpr std::size_t kUsualStep = 1;
/// Over which nothing but rounding changes a function: in widths, and at least some ulps of a unit
/// direction.
constexpr double kRoundingStep = 1e-11;
constexpr double kRoundingUlps = 1e-15;
/// Of the slopes from either side.
constexpr std::array<double, 5> kSideSteps{1e-3, 1e-4, 1e-5, 1e-6, 1e-7};
/// What slopes from one side, of second order only, may be off; in tolerances.
constexpr double kSideTolerance = 10.0;

}  // namespace

DerivativeJudge::DerivativeJudge(Functions functions, Values derivatives, double width,
                                 double floor, double tolerance)
    : f_(std::move(functions)),
      derivatives_(std::move(derivatives)),
      width_(width),
      floor_(floor),
      tolerance_(tolerance),
      numerics_(static_cast<std::size_t>(derivatives_.size())),
      checks_(static_cast<std::size_t>(derivatives_.size())) {
  static_assert(kSteps.size() == kStepCount);
}

std::vector<DerivativeCheck> DerivativeJudge::run() {
  measure_rounding();
  compare(kUsualStep);
  for (std::size_t k = 0; k < kStepCount && !all_agree(); ++k)
    if (k != kUsualStep) compare(k);
  if (all_agree()) return checks_;
  for (std::size_t i = 0; i < checks_.size(); ++i)
    if (checks_[i].verdict != Verdict::Agrees) conclude(i);
  for (const double step : kSideSteps) look_from_each_side(step * width_);
  return checks_;
}

bool DerivativeJudge::all_agree() const {
  return std::all_of(checks_.begin(), checks_.end(),
                     [](const auto& check) { return check.verdict == Verdict::Agrees; });
}

double DerivativeJudge::scale(double derivative, double numeric) const {
  return std::max({std::abs(derivative), std::abs(numeric), floor_});
}

/// Changes of f, but for what is linear, over a few steps that are next to nothing.
void DerivativeJudge::measure_rounding() {
  const Values f0 = f_(0.0);
  rounding_ = Values::Zero(f0.size());
  const double step = std::max(kRoundingStep * width_, kRoundingUlps);
  for (int i = 1; i <= 4; ++i) {
    const double x = i * step;
    rounding_ = rounding_.max((0.5 * (f_(x) + f_(-x)) - f0).abs());
  }
}

/// Ridders' method from step k, and which derivatives agree with it.
void DerivativeJudge::compare(std::size_t k) {
  std::vector<RiddersTableau> tableaus(checks_.size());
  const double first = kSteps.at(k) * width_;
  double h = first;
  for (bool more = true; more; h /= RiddersTableau::kRatio) {
    const Values slope = (f_(h) - f_(-h)) / (2.0 * h);
    more = false;
    for (std::size_t i = 0; i < checks_.size(); ++i)
      more = tableaus[i].add(slope[static_cast<Eigen::Index>(i)]) || more;
  }
  for (std::size_t i = 0; i < checks_.size(); ++i) {
    // The tableau may take rounding for agreement.
    Derivative& numeric = numerics_[i].at(k);
    numeric = tableaus[i].best();
    const double smallest = std::ldexp(first, -static_cast<int>(tableaus[i].best_step()));
    numeric.error += rounding_[static_cast<Eigen::Index>(i)] / smallest;
    const double unit = scale(derivative(i), numeric.value);
    const double difference = std::abs(derivative(i) - numeric.value);
    if (checks_[i].verdict != Verdict::Agrees && std::isfinite(difference) &&
        difference + numeric.error <= tolerance_ * unit)
      checks_[i] = {numeric, difference / unit, Verdict::Agrees};
  }
}

/// For a derivative that agrees with no differences: it is wrong if those from the smallest step of
/// all that are accurate enough say so, and no smaller step contradicts them.
void DerivativeJudge::conclude(std::size_t i) {
  DerivativeCheck& check = checks_[i];
  check.error = kInfinity;
  if (!std::isfinite(derivative(i))) {
    check.verdict = Verdict::Wrong;
    return;
  }
  for (std::size_t k = kStepCount; k-- > 0;) {
    const Derivative& numeric = numerics_[i].at(k);
    const double allowed = tolerance_ * scale(derivative(i), numeric.value);
    const bool accurate = numeric.error <= allowed;
    if (!std::isfinite(numeric.value) || !(accurate || numeric.error < check.numeric.error))
      continue;
    const double difference = std::abs(derivative(i) - numeric.value);
    const bool wrong = accurate && difference > allowed + numeric.error && !contradicted(i, k);
    check = {numeric, difference / (allowed / tolerance_),
             wrong ? Verdict::Wrong : Verdict::Undecided};
    if (accurate) return;
  }
}

/// A wide step may step over a detail, such as a texel.
bool DerivativeJudge::contradicted(std::size_t i, std::size_t k) const {
  const Derivative& wide = numerics_[i].at(k);
  return std::any_of(numerics_[i].begin() + static_cast<std::ptrdiff_t>(k) + 1, numerics_[i].end(),
                     [&](const Derivative& numeric) {
                       return std::abs(numeric.value - wide.value) > numeric.error + wide.error;
                     });
}

/// A kink, or an edge: the derivative is that of one side only.
void DerivativeJudge::look_from_each_side(double h) {
  const Values f0 = f_(0.0);
  const Values right = (-3.0 * f0 + 4.0 * f_(h) - f_(2.0 * h)) / (2.0 * h);
  const Values left = (3.0 * f0 - 4.0 * f_(-h) + f_(-2.0 * h)) / (2.0 * h);
  for (std::size_t i = 0; i < checks_.size(); ++i) {
    if (checks_[i].verdict == Verdict::Agrees || checks_[i].verdict == Verdict::Kink) continue;
    const auto k = static_cast<Eigen::Index>(i);
    if (is_slope_of(left[k], i) != is_slope_of(right[k], i)) checks_[i].verdict = Verdict::Kink;
  }
}

bool DerivativeJudge::is_slope_of(double side, std::size_t i) const {
  return std::abs(side - derivative(i)) <= kSideTolerance * tolerance_ * scale(derivative(i), side);
}

}  // namespace driftlight
