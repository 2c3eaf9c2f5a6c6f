// SPDX-License-Identifier: Apache-2.0
/// Checks the derivatives that production code computes for a path against independent ones.
///
/// Errors are in units of the widths of the path, in which U and the residuals change by about one:
/// coordinate j has the width w_j = 1 / (3 sqrt(Q_jj)), at most 1. With D = diag Q, the norm |.|
/// and E the truth:
///   gradient, jets and hand      |D^-1/2 (g - E)| / (1 + |D^-1/2 E|)
///   gradient, jets and Ridders   |g_j - E_j| / max(|g_j|, |E_j|, 0.01 / w_j), each coordinate
///   Jacobian, jets and hand      |column j of J - E| / sqrt(Q_jj), each coordinate
///   Jacobian, jets and Ridders   |J_rj - E_rj| / sqrt(Q_jj), each entry
///   divergence, differences and Jets of Jets
///                                |x_i - E_i| / s_i, each coordinate, with P = Q^-1 and
///                                s = |P| sum_j (|dQ_j| + 0.01 D^1/2 1 1^T D^1/2 / w_j) |P| e_j:
///                                the relative error of the derivatives dQ_j that explains it, free
///                                of what the condition of Q makes of them.
/// Columns of J D^-1/2 are at most 1 long.
///
/// Ridders' differences start from several steps, and a coordinate agrees if it does with one of
/// them together with that one's own estimate of its error. One that does not is told apart by
/// slopes from either side: at a kink (between texels of a bilinear texture, say) or at the edge
/// where light ends, the derivative is that of one side and not of the other. The divergence is at
/// a kink if half the jump of the slope of Q within the step of its differences explains the error.
///
/// A coordinate is undecided where nothing can be said: differences are not accurate enough, or
/// moves of the coordinates by a few ulps change the derivatives as much as hand and jets differ
/// (next to the silhouette of a sphere or to total reflection). Kinks and undecided coordinates are
/// counted, and bounded by who calls.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "driftlight/divergence.h"
#include "driftlight/finite_difference.h"
#include "driftlight/linearization.h"

namespace driftlight {

/// What is compared with what.
enum class Quantity : std::uint8_t {
  GradientHand,
  GradientRidders,
  JacobianHand,
  JacobianRidders,
  Divergence,
};
inline constexpr std::size_t kQuantityCount = 5;
inline constexpr std::array<Quantity, kQuantityCount> kQuantities{
    Quantity::GradientHand, Quantity::GradientRidders, Quantity::JacobianHand,
    Quantity::JacobianRidders, Quantity::Divergence};

/// "gradient_hand", ..
std::string_view name(Quantity quantity);
/// Largest relative error that passes: 1e-10 between jets and hand, 1e-6 against Ridders, and 1e-5
/// for the divergence. The central differences of divergence.h are off by some 1e-10 on most paths
/// and by 1e-6 on one in a thousand, where edges are short.
double tolerance(Quantity quantity);

/// One quantity on one path.
struct Comparison {
  double error = 0;   ///< relative, the worst of what was compared
  int compared = 0;   ///< coordinates; 1 for what is a single norm
  int kinks = 0;      ///< coordinates set aside
  int undecided = 0;  ///< coordinates where differences do not decide

  bool passes(Quantity quantity) const { return error <= tolerance(quantity); }
};

/// The functions under test; tests replace single ones by wrong ones.
struct DerivativeFunctions {
  using Linearize = std::function<void(const Scene&, const PathTopology&, const Chart&,
                                       const DerivativeRequest&, Linearization&)>;

  Linearize by_jets = linearize_by_jets;
  Linearize by_hand = linearize_by_hand;
  std::function<Vector(const Scene&, const PathTopology&, const Chart&)> divergence =
      [](const auto& scene, const auto& topology, const auto& chart) {
        return driftlight::divergence(scene, topology, chart);
      };
};

/// What is checked.
struct CheckSelection {
  bool gradient = true;
  bool constraints = true;  ///< the residual Jacobians
  bool divergence = true;
  bool hand = true;  ///< if not, jets against differences only
};

enum class Verdict : std::uint8_t { Agrees, Wrong, Kink, Undecided };

/// A derivative against its differences.
struct DerivativeCheck {
  Derivative numeric;
  double error = 0;  ///< relative
  Verdict verdict = Verdict::Undecided;
};

/// All that is known of one path; what was not asked for is empty.
struct PathCheck {
  std::array<Comparison, kQuantityCount> results;
  Chart chart;
  Matrix q;
  Vector gradient_jets;
  Vector gradient_hand;
  std::vector<DerivativeCheck> gradient;  ///< by coordinate
  Jacobian jacobian_jets;
  Jacobian jacobian_hand;
  std::vector<std::vector<DerivativeCheck>> jacobian;  ///< by coordinate, then residual
  Vector divergence;
  Vector exact_divergence;

  const Comparison& operator[](Quantity quantity) const {
    return results[static_cast<std::size_t>(quantity)];
  }
  bool passes() const;
};

/// Checks one path that carries light.
PathCheck check_path(const Scene& scene, const PathTopology& topology,
                     const PathCoordinates& coordinates, const CheckSelection& selection = {},
                     const DerivativeFunctions& functions = DerivativeFunctions());

/// True if f > 1e-300. Below, nothing ever comes to the image, and its colour, a product, may have
/// lost its digits.
bool carries_light(double log_target);

}  // namespace driftlight
