// SPDX-License-Identifier: Apache-2.0
#include "driftlight/gradient_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "derivative_judge.h"
#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "driftlight/exact_divergence.h"

namespace driftlight {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Of gradients, in widths.
constexpr double kGradientFloor = 0.01;
/// Of slopes of Q, in widths.
constexpr double kSlopeFloor = 0.01;

double max_or_infinity(double a, double b) { return std::isfinite(b) ? std::max(a, b) : kInfinity; }

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

  // ---- By hand ----

  void compare_gradient_by_hand(const Linearization& hand) {
    check_.gradient_hand = hand.gradient;
    const double scale = 1.0 + scaled(check_.gradient_jets).norm();
    const double error = scaled(hand.gradient - check_.gradient_jets).norm() / scale;
    double rounding = 0;
    if (error > tolerance(Quantity::GradientHand))
      rounding = largest_nearby([&](const Linearization& path) {
        return scaled(path.gradient - check_.gradient_jets).norm() / scale;
      });
    add(error, rounding, Quantity::GradientHand);
  }

  void compare_jacobian_by_hand(const Linearization& hand) {
    check_.jacobian_hand = jacobian(hand);
    const auto error = [&](const Jacobian& other, int j) {
      return (other.col(j) - check_.jacobian_jets.col(j)).norm() / root(j);
    };
    const bool same_rows = check_.jacobian_hand.rows() == check_.jacobian_jets.rows();
    for (int j = 0; j < dimension(); ++j) {
      const double at = same_rows ? error(check_.jacobian_hand, j) : kInfinity;
      double rounding = 0;
      if (same_rows && at > tolerance(Quantity::JacobianHand))
        rounding =
            largest_nearby([&](const Linearization& path) { return error(jacobian(path), j); });
      add(at, rounding, Quantity::JacobianHand);
    }
  }

  /// In units of the widths.
  Vector scaled(const Vector& x) const { return x.cwiseQuotient(check_.q.diagonal().cwiseSqrt()); }

  /// An error that the rounding of the coordinates may have made decides nothing.
  void add(double error, double rounding, Quantity quantity) {
    Comparison& comparison = result(quantity);
    if (std::isfinite(error) && error > tolerance(quantity) && error <= rounding) {
      ++comparison.undecided;
      return;
    }
    ++comparison.compared;
    comparison.error = max_or_infinity(comparison.error, error);
  }

  /// The largest change that moves of a few ulps in all coordinates make of derivatives by jets.
  template <class Change>
  double largest_nearby(const Change& change) const {
    constexpr double kUlps = 4.0 * std::numeric_limits<double>::epsilon();
    double largest = 0;
    Linearization path;
    for (unsigned pattern = 0; pattern < 8; ++pattern) {
      // Rows of a Hadamard matrix: independent signs.
      Vector delta(dimension());
      for (int j = 0; j < dimension(); ++j)
        delta[j] = std::popcount(pattern & static_cast<unsigned>(j)) % 2 == 0 ? kUlps : -kUlps;
      functions_.by_jets(scene_, topology_, check_.chart.displaced(delta), {}, path);
      largest = std::max(largest, change(path));
    }
    return largest;
  }

  // ---- By differences ----

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
      const auto checks =
          DerivativeJudge(potential, derivative, width(j), kGradientFloor / width(j),
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
          DerivativeJudge(f, derivatives, width(j), root(j), tolerance(Quantity::JacobianRidders))
              .run());
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
  /// Difference of the slopes of Q from both sides at the step h, h Q'' where it is smooth.
  Matrix bend(int j, double h) const { return (q_at(j, h) + q_at(j, -h) - 2.0 * q_at(j, 0.0)) / h; }
  /// What of the bend is none of Q'': the jump of the slope at a kink within h. Two differences, as
  /// each has a place within h where a kink does not show.
  Matrix kink(int j, double h) const {
    const Matrix whole = bend(j, h);
    return (whole - 4.0 * bend(j, h / 4.0))
        .cwiseAbs()
        .cwiseMax((whole - 16.0 * bend(j, h / 16.0)).cwiseAbs());
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
    const Matrix inverse = cholesky.solve(Matrix::Identity(dimension(), dimension()));
    const Vector roots = check_.q.diagonal().cwiseSqrt();
    const Vector scale = spread(inverse, [&](int j) {
      const Matrix floor = (kSlopeFloor / width(j)) * roots * roots.transpose();
      return Matrix(slope(j, step(j)).cwiseAbs() + floor);
    });
    if (cholesky.info() != Eigen::Success || !difference.allFinite() || !scale.allFinite()) {
      comparison.undecided = 1;
      return;
    }
    comparison.compared = 1;
    comparison.error = difference.cwiseQuotient(scale).maxCoeff();
    const double allowed = tolerance(Quantity::Divergence);
    if (comparison.error > allowed) excuse(inverse, difference - allowed * scale, comparison);
  }

  /// The step of the differences in divergence.h.
  double step(int j) const { return 1e-4 * width(j); }

  /// Sets the divergence aside if what it is off too much comes from a kink within the step, which
  /// moves differences by up to half the jump of the slope, or from their truncation.
  void excuse(const Matrix& inverse, const Vector& excess, Comparison& comparison) const {
    const auto explained_by = [&](const auto& errors) {
      return (excess.array() <= spread(inverse, errors).array()).all();
    };
    const auto half_jump = [&](int j) { return Matrix(0.6 * kink(j, step(j))); };
    const auto truncation = [&](int j) {
      return Matrix(1.1 * (slope(j, step(j)) - slope(j, 0.25 * step(j))));
    };
    const bool at_kink = explained_by(half_jump);
    if (!at_kink && !explained_by(truncation)) return;
    comparison = {};
    ++(at_kink ? comparison.kinks : comparison.undecided);
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
  return std::isfinite(log_target) && log_target > -300.0 * std::log(10.0);
}

}  // namespace driftlight
