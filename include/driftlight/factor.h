// SPDX-License-Identifier: Apache-2.0
/// Square roots of a precision matrix: Q = F^T F, whatever the shape of F.
///
/// A Gaussian step with precision Q needs F only: F^-1 xi has covariance Q^-1, |F delta|^2 =
/// delta^T Q delta, and |F^-T a|^2 = a^T Q^-1 a. Each factor below offers the same four members.
#pragma once

#include <variant>

#include "driftlight/two_sided_factor.h"

namespace driftlight {

/// F = I / 3: steps of unit standard deviation at dt = 1/3.
class IdentityFactor {
 public:
  explicit IdentityFactor(int dimension = 0) : dimension_(dimension) {}

  double log_det() const;
  Vector apply(const Vector& x) const { return x / 3.0; }
  Vector solve(const Vector& x) const { return 3.0 * x; }
  Vector solve_transposed(const Vector& x) const { return 3.0 * x; }

 private:
  int dimension_;
};

/// F = L^T of a dense matrix Q = L L^T.
class CholeskyFactor {
 public:
  /// From the lower triangle of Q; none if it is not positive definite.
  static std::optional<CholeskyFactor> of(const Matrix& q);

  /// log |det F|
  double log_det() const;
  /// F x
  Vector apply(const Vector& x) const;
  /// F^-1 x
  Vector solve(const Vector& x) const;
  /// F^-T x
  Vector solve_transposed(const Vector& x) const;

 private:
  Matrix l_;
};

/// F of the constraints of a path, from its stages (linearization.h) by the Riccati recursion of
/// linear-quadratic control; Q itself is never formed. With s_k^T P_k s_k the cost to go, the least
/// that the residuals after stage k add to delta^T Q delta over all later blocks, and M_k =
/// (rows)^T (rows) of stage k in the variables (s, u),
///   H = M_k + E^T P_k E + floor,  E = [A_k 0; 0 I]  (free),   P_{k-1} = H_ss - H_su K,
///   Lambda = H_uu = R^T R,  K = Lambda^-1 H_us,
///   P_{k-1} = M_k + [A_k; D_k]^T P_k [A_k; D_k]     (delta),
/// at a point, which comes first, with E = [0 I; 0 0],
/// and completing squares gives delta^T Q delta = sum_b |R_b (u_b + K_b s)|^2 = |F delta|^2: block
/// b of F delta is R_b (u_b + K_b s) with s run forward from 0. F is block lower triangular, and
/// every member costs O(length).
class RiccatiFactor {
 public:
  using Status = FactorStatus;

  RiccatiFactor() = default;
  /// Unless `status` is Ok afterwards no other member may be used.
  explicit RiccatiFactor(const Linearization& path);

  Status status() const { return status_; }
  double log_det() const { return log_det_; }
  Vector apply(const Vector& x) const;
  Vector solve(const Vector& x) const;
  Vector solve_transposed(const Vector& x) const;

 private:
  /// Two rows over s: a map to R^2.
  struct Pair {
    Eigen::Array4d first, second;
  };
  struct Step {
    // Initialised: a factor is copied with the steps that its path does not reach.
    Stage::Kind kind = Stage::Kind::Free;
    bool has_block = false;
    /// R = [r00 r01; 0 r11], and the inverses of its diagonal.
    double r00, r01, r11, inverse00, inverse11;
    Pair gain;  ///< K
    Pair position;
    Pair direction;
  };

  /// s_k from s_{k-1} and the block u of stage k.
  static Eigen::Array4d next_state(const Step& step, int k, const Eigen::Array4d& s, double u0,
                                   double u1);

  std::array<Step, kMaxStages> steps_;
  int step_count_ = 0;
  int dimension_ = 0;
  double log_det_ = 0;
  Status status_ = Status::Ok;
};

using Factor = std::variant<IdentityFactor, CholeskyFactor, RiccatiFactor, TwoSidedFactor>;

/// Sets `factor` to that of the constraints of a path: Riccati's, with a light side that of both
/// sides. Unless the status is Ok it has no use.
FactorStatus factorise(const Linearization& path, Factor& factor);

}  // namespace driftlight
