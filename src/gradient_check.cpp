// SPDX-License-Identifier: Apache-2.0
#include "driftlight/gradient_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "driftlight/exact_divergence.h"

namespace driftlight {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// First steps of Ridders' method, in widths: the smaller ones see past a kink close by and fit
/// into what is left before an edge.
constexpr std::array<double, 4> kSteps{1e-2, 1e-3, 1e-4, 1e-5};
/// Of the slopes from either side.
constexpr std::array<double, 3> kSideSteps{1e-3, 1e-4, 1e-5};
/// What slopes from one side may be off, of second order as they are, in tolerances.
constexpr double kSideTolerance = 10.0;
/// Of gradients, in widths.
constexpr double kGradientFloor = 0.01;
/// Of slopes of Q, in widths.
constexpr double kSlopeFloor = 0.01;

double max_or_infinity(double a, double b) { return std::isfinite(b) ? std::max(a, b) : kInfinity; }

// ---- Derivatives against differences ----------------------------------------------------------

/// Values of several functions of one coordinate.
using Values = Eigen::Array<double, Eigen::Dynamic, 1, 0, kMaxResiduals, 1>;

/// Judges derivatives of f at 0, all at once. F: Values(double x).
template <class F>
class Judge {
 public:
  /// `floor` is the smallest scale of the relative errors.
  Judge(const F& f, const Values& derivatives, double width, double floor, double tolerance)
      : f_(f),
        derivatives_(derivatives),
        width_(width),
        floor_(floor),
        tolerance_(tolerance),
        checks_(static_cast<std::size_t>(derivatives.size())) {}

  std::vector<DerivativeCheck> run() {
    for (DerivativeCheck& check : checks_) check.error = kInfinity;
    for (const double step : kSteps) {
      compare(step * width_);
      if (all_agree()) return std::move(checks_);
    }
    for (const double step : kSideSteps) look_from_each_side(step * width_);
    return std::move(checks_);
  }

 private:
  bool all_agree() const {
    return std::all_of(checks_.begin(), checks_.end(),
                       [](const auto& check) { return check.verdict == Verdict::Agrees; });
  }
  double derivative(std::size_t i) const { return derivatives_[static_cast<Eigen::Index>(i)]; }
  double scale(double derivative, double numeric) const {
    return std::max({std::abs(derivative), std::abs(numeric), floor_});
  }

  void compare(double h) {
    std::vector<RiddersTableau> tableaus(checks_.size());
    for (bool more = true; more; h /= RiddersTableau::kRatio) {
      const Values slope = (f_(h) - f_(-h)) / (2.0 * h);
      more = false;
      for (std::size_t i = 0; i < checks_.size(); ++i)
        more = tableaus[i].add(slope[static_cast<Eigen::Index>(i)]) || more;
    }
    for (std::size_t i = 0; i < checks_.size(); ++i)
      take(derivative(i), tableaus[i].best(), checks_[i]);
  }

  /// Keeps the differences that agree, else those that claim to be the best.
  void take(double derivative, const Derivative& numeric, DerivativeCheck& check) const {
    if (check.verdict == Verdict::Agrees) return;
    if (!std::isfinite(derivative)) {
      check = {numeric, kInfinity, Verdict::Wrong};
      return;
    }
    if (!std::isfinite(numeric.value) || !std::isfinite(numeric.error)) return;
    const double unit = scale(derivative, numeric.value);
    const double difference = std::abs(derivative - numeric.value);
    const double allowed = tolerance_ * unit;
    if (difference + numeric.error <= allowed) {
      check = {numeric, difference / unit, Verdict::Agrees};
    } else if (numeric.error < check.numeric.error) {
      const bool certain = difference > allowed + numeric.error && numeric.error <= allowed;
      check = {numeric, difference / unit, certain ? Verdict::Wrong : Verdict::Undecided};
    }
  }

  /// A kink, or an edge: the derivative is that of one side only.
  void look_from_each_side(double h) {
    const Values f0 = f_(0.0);
    const Values right = (-3.0 * f0 + 4.0 * f_(h) - f_(2.0 * h)) / (2.0 * h);
    const Values left = (3.0 * f0 - 4.0 * f_(-h) + f_(-2.0 * h)) / (2.0 * h);
    for (std::size_t i = 0; i < checks_.size(); ++i) {
      if (checks_[i].verdict != Verdict::Wrong && checks_[i].verdict != Verdict::Undecided)
        continue;
      const auto k = static_cast<Eigen::Index>(i);
      if (is_slope_of(left[k], i) != is_slope_of(right[k], i)) checks_[i].verdict = Verdict::Kink;
    }
  }
  bool is_slope_of(double side, std::size_t i) const {
    return std::abs(side - derivative(i)) <=
           kSideTolerance * tolerance_ * scale(derivative(i), side);
  }

  const F& f_;
  const Values& derivatives_;
  double width_;
  double floor_;
  double tolerance_;
  std::vector<DerivativeCheck> checks_;
};

/// Adds one coordinate's checks: it is set aside if one of its entries is, but counts with those
/// that are not.
void add_coordinate(const std::vector<DerivativeCheck>& checks, Comparison& result) {
  bool kink = false;
  bool undecided = false;
  for (const DerivativeCheck& check : checks) {
    kink = kink || check.verdict == Verdict::Kink;
    undecided = undecided || check.verdict == Verdict::Undecided;
    if (check.verdict == Verdict::Agrees || check.verdict == Verdict::Wrong)
      result.error = max_or_infinity(result.error, check.error);
  }
  if (kink)
    ++result.kinks;
  else if (undecided)
    ++result.undecided;
  else
    ++result.compared;
}

// ---- One path ---------------------------------------------------------------------------------

/// Scaled residuals sqrt(w)/3 r, w at the chart's base point.
class ScaledResiduals {
 public:
  ScaledResiduals(const Scene& scene, const PathTopology& topology, const Chart& chart)
      : scene_(scene), topology_(topology), chart_(chart) {
    const Sink base = at(Vector::Zero(chart.dimension()));
    factors_ = base.precisions.head(base.count).sqrt() / 3.0;
  }

  Eigen::Index count() const { return factors_.size(); }
  /// NaN where other residuals come out.
  Values operator()(const Vector& delta) const {
    const Sink sink = at(delta);
    if (sink.count != count()) return Values::Constant(count(), kNan);
    return factors_ * sink.residuals.head(count());
  }

 private:
  struct Sink {
    Eigen::Array<double, kMaxResiduals, 1> residuals;
    Eigen::Array<double, kMaxResiduals, 1> precisions;
    Eigen::Index count = 0;

    void add(double residual, double precision) {
      residuals[count] = residual;
      precisions[count++] = precision;
    }
  };

  Sink at(const Vector& delta) const {
    Sink sink;
    ConstraintVisitor<double, Sink> visitor(sink);
    walk<double>(scene_, topology_, chart_.retract(delta), visitor);
    return sink;
  }

  const Scene& scene_;
  const PathTopology& topology_;
  const Chart& chart_;
  Values factors_;
};

class PathChecker {
 public:
  PathChecker(const Scene& scene, const PathTopology& topology, const PathCoordinates& coordinates,
              const DerivativeFunctions& functions, PathCheck& check)
      : scene_(scene), topology_(topology), functions_(functions), check_(check) {
    check_.chart = Chart(scene, topology, coordinates);
  }

  void run(const CheckSelection& selection) {
    Linearization path;
    functions_.by_jets(scene_, topology_, check_.chart, {}, path);
    check_.gradient_jets = path.gradient;
    check_.jacobian_jets = jacobian(path);
    check_.q = constraint_matrix(path);
    if (selection.hand) {
      functions_.by_hand(scene_, topology_, check_.chart, {}, path);
      if (selection.gradient) compare_gradient_by_hand(path);
      if (selection.constraints) compare_jacobian_by_hand(path);
    }
    if (selection.gradient) compare_gradient_by_differences();
    if (selection.constraints) compare_jacobian_by_differences();
    if (selection.divergence) compare_divergence();
  }

 private:
  Comparison& result(Quantity quantity) {
    return check_.results[static_cast<std::size_t>(quantity)];
  }
  int dimension() const { return check_.chart.dimension(); }
  double root(int j) const { return std::sqrt(check_.q(j, j)); }
  double width(int j) const { return std::min(1.0, 1.0 / (3.0 * root(j))); }

  void compare_gradient_by_hand(const Linearization& hand) {
    check_.gradient_hand = hand.gradient;
    const Vector roots = check_.q.diagonal().cwiseSqrt();
    const Vector difference = (hand.gradient - check_.gradient_jets).cwiseQuotient(roots);
    const double norm = check_.gradient_jets.cwiseQuotient(roots).norm();
    Comparison& comparison = result(Quantity::GradientHand);
    comparison.compared = 1;
    comparison.error = max_or_infinity(0.0, difference.norm() / (1.0 + norm));
  }

  void compare_jacobian_by_hand(const Linearization& hand) {
    check_.jacobian_hand = jacobian(hand);
    Comparison& comparison = result(Quantity::JacobianHand);
    comparison.compared = dimension();
    if (check_.jacobian_hand.rows() != check_.jacobian_jets.rows()) {
      comparison.error = kInfinity;
      return;
    }
    for (int j = 0; j < dimension(); ++j) {
      const double difference = (check_.jacobian_hand.col(j) - check_.jacobian_jets.col(j)).norm();
      comparison.error = max_or_infinity(comparison.error, difference / root(j));
    }
  }

  Vector unit(int j, double x) const {
    Vector delta = Vector::Zero(dimension());
    delta[j] = x;
    return delta;
  }

  void compare_gradient_by_differences() {
    for (int j = 0; j < dimension(); ++j) {
      const auto potential = [&](double x) {
        const PathCoordinates moved = check_.chart.retract(unit(j, x));
        return Values(Values::Constant(1, -contribution(scene_, topology_, moved).log_target));
      };
      const Values derivative = Values::Constant(1, check_.gradient_jets[j]);
      const auto checks = Judge(potential, derivative, width(j), kGradientFloor / width(j),
                                tolerance(Quantity::GradientRidders))
                              .run();
      check_.gradient.push_back(checks.front());
      add_coordinate(checks, result(Quantity::GradientRidders));
    }
  }

  void compare_jacobian_by_differences() {
    const ScaledResiduals residuals(scene_, topology_, check_.chart);
    Comparison& comparison = result(Quantity::JacobianRidders);
    if (residuals.count() != check_.jacobian_jets.rows()) {
      comparison.error = kInfinity;
      return;
    }
    for (int j = 0; j < dimension(); ++j) {
      const auto f = [&](double x) { return residuals(unit(j, x)); };
      const Values derivatives = check_.jacobian_jets.col(j);
      check_.jacobian.push_back(
          Judge(f, derivatives, width(j), root(j), tolerance(Quantity::JacobianRidders)).run());
      add_coordinate(check_.jacobian.back(), comparison);
    }
  }

  // ---- Divergence ----

  Matrix q_at(int j, double x) const {
    Matrix q;
    constraint_matrix(scene_, topology_, check_.chart, unit(j, x), q);
    return q.selfadjointView<Eigen::Lower>();
  }
  Matrix slope(int j, double h) const { return (q_at(j, h) - q_at(j, -h)) / (2.0 * h); }
  /// Difference of the slopes from both sides.
  Matrix gap(int j, double h) const {
    return (4.0 * (q_at(j, h) + q_at(j, -h)) - q_at(j, 2.0 * h) - q_at(j, -2.0 * h) -
            6.0 * q_at(j, 0.0)) /
           (2.0 * h);
  }
  /// |P| sum_j |M_j| |P| e_j: what errors M_j of dQ / d delta_j make of the divergence, at most.
  template <class MatrixOf>
  Vector spread(const Matrix& inverse, const MatrixOf& matrix_of) const {
    Vector sum = Vector::Zero(dimension());
    for (int j = 0; j < dimension(); ++j)
      sum += Matrix(matrix_of(j).cwiseAbs()) * inverse.col(j).cwiseAbs();
    return inverse.cwiseAbs() * sum;
  }

  void compare_divergence() {
    Comparison& comparison = result(Quantity::Divergence);
    check_.divergence = functions_.divergence(scene_, topology_, check_.chart);
    check_.exact_divergence = exact_divergence(scene_, topology_, check_.chart);
    const Vector difference = (check_.divergence - check_.exact_divergence).cwiseAbs();
    const Eigen::LLT<Matrix> cholesky(check_.q);
    if (cholesky.info() != Eigen::Success || !difference.allFinite()) {
      comparison.undecided = 1;
      return;
    }
    const Matrix inverse = cholesky.solve(Matrix::Identity(dimension(), dimension()));
    const Vector roots = check_.q.diagonal().cwiseSqrt();
    const auto step = [&](int j) { return 1e-4 * width(j); };
    const Vector scale = spread(inverse, [&](int j) {
      const Matrix floor = (kSlopeFloor / width(j)) * roots * roots.transpose();
      return Matrix(slope(j, step(j)).cwiseAbs() + floor);
    });
    const double error = difference.cwiseQuotient(scale).maxCoeff();
    if (error > tolerance(Quantity::Divergence)) {
      // A kink within the step moves the difference by up to half the gap of the slopes.
      const auto half_gap = [&](int j) { return Matrix(0.6 * gap(j, step(j))); };
      const auto truncation = [&](int j) {
        return Matrix(1.1 * (slope(j, step(j)) - slope(j, 0.25 * step(j))));
      };
      const Vector allowed = tolerance(Quantity::Divergence) * scale;
      const auto explains = [&](const auto& errors) {
        return (difference.array() <= (allowed + spread(inverse, errors)).array()).all();
      };
      comparison.kinks = explains(half_gap) ? 1 : 0;
      comparison.undecided = comparison.kinks == 0 && explains(truncation) ? 1 : 0;
      if (comparison.kinks + comparison.undecided > 0) return;
    }
    comparison.compared = 1;
    comparison.error = max_or_infinity(0.0, error);
  }

  const Scene& scene_;
  const PathTopology& topology_;
  const DerivativeFunctions& functions_;
  PathCheck& check_;
};

}  // namespace

std::string_view name(Quantity quantity) {
  constexpr std::array<std::string_view, kQuantityCount> kNames{
      "gradient_hand", "gradient_ridders", "jacobian_hand", "jacobian_ridders", "divergence"};
  return kNames.at(static_cast<std::size_t>(quantity));
}

double tolerance(Quantity quantity) {
  constexpr std::array<double, kQuantityCount> kTolerances{1e-10, 1e-6, 1e-10, 1e-6, 1e-5};
  return kTolerances.at(static_cast<std::size_t>(quantity));
}

bool PathCheck::passes() const {
  return std::all_of(kQuantities.begin(), kQuantities.end(),
                     [&](Quantity quantity) { return (*this)[quantity].passes(quantity); });
}

PathCheck check_path(const Scene& scene, const PathTopology& topology,
                     const PathCoordinates& coordinates, const CheckSelection& selection,
                     const DerivativeFunctions& functions) {
  PathCheck check;
  PathChecker(scene, topology, coordinates, functions, check).run(selection);
  return check;
}

bool carries_light(double log_target) {
  return std::isfinite(log_target) && std::exp(log_target) >= std::numeric_limits<double>::min();
}

}  // namespace driftlight
