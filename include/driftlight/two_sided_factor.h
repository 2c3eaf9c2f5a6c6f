// SPDX-License-Identifier: Apache-2.0
/// Square root of the constraints of a path with a light side.
#pragma once

#include <array>

#include "driftlight/linearization.h"

namespace driftlight {

/// Why there is no factor.
enum class FactorStatus {
  Ok,
  Indefinite,  ///< rounding left some pivot without a root
  NonFinite,   ///< some derivative was
};

/// F with Q = F^T F by the Riccati recursion of RiccatiFactor, first along the sensor's side with
/// the state r of the light's end of the joining edge as a parameter: the cost to go is
/// (s, r)^T P_k (s, r), at first (rows)^T (rows) of the last stage, and
///   H = M_k + E^T P_k E + floor in the variables (s, r, u),  E = [A_k 0 0; 0 0 I; 0 I 0]   (free)
///   Lambda = H_uu = R^T R,  K = Lambda^-1 H_u(s,r),  P_{k-1} = H_(s,r)(s,r) - H_(s,r)u K
/// as there for delta. What is left at the sensor is a cost of r alone, from which the recursion
/// goes on along the light side. A block of F delta is R (u + K (s, r)), with r = 0 on the light
/// side: F is block triangular if the light side comes first, and every member costs O(length).
class TwoSidedFactor {
 public:
  TwoSidedFactor() = default;
  /// Unless `status` is Ok afterwards no other member may be used.
  explicit TwoSidedFactor(const Linearization& path);

  FactorStatus status() const { return status_; }
  double log_det() const { return log_det_; }
  /// F x
  Vector apply(const Vector& x) const;
  /// F^-1 x
  Vector solve(const Vector& x) const;
  /// F^-T x
  Vector solve_transposed(const Vector& x) const;

 private:
  /// Over (s, r).
  using Row = Eigen::Array<double, 8, 1>;
  using State = Eigen::Array4d;
  using Cost = std::array<Row, 8>;

  struct Step {
    Stage::Kind kind = Stage::Kind::Free;
    bool has_block = false;
    /// R = [r00 r01; 0 r11], and the inverses of its diagonal.
    double r00 = 1;
    double r01 = 0;
    double r11 = 1;
    double inverse00 = 1;
    double inverse11 = 1;
    Row gain0 = Row::Zero();  ///< K
    Row gain1 = Row::Zero();
    Row a0 = Row::Zero();  ///< A, in the lanes of s
    Row a1 = Row::Zero();
    Row d0 = Row::Zero();  ///< D
    Row d1 = Row::Zero();
  };
  struct Side {
    int begin;  ///< steps
    int end;
    int blocks_end;  ///< one past the last block
  };

  bool eliminate(const Linearization& path, int k, bool first, const LocalColumns& columns,
                 Cost& cost);
  bool eliminate_block(double a, double b, double c, Row us0, Row us1, Step& step, Cost& cost);
  Side sensor_side() const { return {0, sensor_steps_, sensor_blocks_}; }
  Side light_side() const { return {sensor_steps_, step_count_, dimension_ / 2}; }
  /// Runs a side forward; block(step, b, gain terms, u) sets u, and all there is to set of it.
  template <class Block>
  State run(const Side& side, const State& other, const Block& block) const;
  /// The adjoint of `solve` along a side: of the state behind it; returns that of r.
  State run_back(const Side& side, State lambda, const Vector& x, Vector& y) const;

  std::array<Step, kMaxStages> steps_;
  int sensor_steps_ = 0;
  int step_count_ = 0;
  int sensor_blocks_ = 0;
  int dimension_ = 0;
  double log_det_ = 0;
  FactorStatus status_ = FactorStatus::Ok;
};

}  // namespace driftlight
