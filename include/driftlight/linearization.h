// SPDX-License-Identifier: Apache-2.0
/// Derivatives of a path, stage by stage: the path as a dynamical system.
///
/// Vertex x_k depends on the directions v_0 .. v_{k-1} only, and on them only through the ray that
/// arrives. With s_k = (xi_k, omega_k) in R^4 the displacement of the ray that leaves x_k (xi_k
/// moves x_k in its tangent plane, omega_k turns v_k) and u_b in R^2 the tangent coordinates of
/// block b, stage k is
///   xi_k = A_k s_{k-1},    omega_k = u_b           v_k is free
///                          omega_k = D_k s_{k-1}   v_k is determined by a delta lobe
/// and log f and the residuals are sums over stages of functions of (s_{k-1}, u_b) alone:
///   d log f = sum_k l_k . (s_{k-1}, u_b),     Q = 1/9 sum_k (rows of stage k)^T (rows) + floor.
/// So every derivative is local, six columns wide, whatever the length of the path; the gradient
/// is one adjoint sweep over the stages, and Q factorises by a Riccati recursion (factor.h). Work
/// grows with the length, where dense Jacobians and Cholesky grow with its square and its cube.
///
/// With a light side there are two such systems: that of the sensor's side and that of the light
/// side, which begins at the emitter and runs along the light. They meet in one last stage, the two
/// ends of the joining edge, whose rows depend on the states of both: there x_(t-1) = A s, x_t = A'
/// s' and all directions follow. The gradient is then an adjoint sweep along each side from there.
#pragma once

#include "driftlight/gradient.h"
#include "driftlight/options.h"

namespace driftlight {

/// Columns of local derivatives: xi (2), omega (2), u (2), and two of padding to a full vector
/// register. On the light side u (2), padding (2), xi (2), omega (2), so that in the last stage
/// both states have their columns: xi and omega of the sensor's side, then of the light side.
inline constexpr int kLocalWidth = 8;
using LocalRow = Eigen::Array<double, 1, kLocalWidth>;

/// First columns of the local variables of a side.
struct LocalColumns {
  int xi;
  int omega;
  int u;
};
inline constexpr LocalColumns kSensorColumns{.xi = 0, .omega = 2, .u = 4};
inline constexpr LocalColumns kLightColumns{.xi = 4, .omega = 6, .u = 0};

/// Most residuals of a path: three of the lens, two of the film, three of each position, three of
/// each lobe of each scattering, three of the environment or of a spot, two of the aperture of each
/// segment.
inline constexpr int kMaxResiduals =
    5 + (3 + 3 * kMaxLobes) * kMaxPathLength + 3 + 2 * kMaxPathLength;
/// Most stages: one for each edge, another for the last vertex, and the points on a lens and on an
/// emitter.
inline constexpr int kMaxStages = kMaxPathLength + 3;

/// The sensor (stage 0; a point on its lens comes before), a scattering vertex, or the end of a
/// path that hits an emitter or leaves the scene; of the light side the emitter (a point there,
/// then emission) or a scattering vertex.
struct Stage {
  enum class Kind : std::uint8_t {
    Free,      ///< takes a block of coordinates, and is followed by another stage
    Delta,     ///< no block of its own; followed by another stage
    Terminal,  ///< the last one, with a block (an emitter point) or without
    Point,     ///< the first of a light side, on a lens or at an orthographic sensor: its block is
               ///< xi of the next
  };
  using Map = Eigen::Matrix<double, 2, 4, Eigen::RowMajor>;

  Kind kind = Kind::Terminal;
  bool has_block = false;
  int rows_end = 0;  ///< one past the last residual row of this stage; they follow each other
  Map position;      ///< A; not set for the first, points and terminal stages
  Map direction;     ///< D; delta stages only
};

/// All derivatives of a path at a chart's base point that a step needs.
struct Linearization {
  /// grad U over the tangent coordinates of the chart; empty if not asked for. (d)
  Vector gradient;
  /// Precision of each coordinate beside its constraints, in Q.
  double floor = kConstraintFloor;
  int stage_count = 0;  ///< 0 if constraints are not asked for
  int block_count = 0;
  bool has_light_side = false;
  int sensor_stages = 0;  ///< with a light side: those before it
  std::array<Stage, kMaxStages> stages;
  /// Rows sqrt(w)/3 dr / d(xi, omega, u) of all residuals r with precision w, in the order of
  /// ConstraintVisitor; behind them in each stage those of apertures (aperture.h).
  Eigen::Array<double, kMaxResiduals, kLocalWidth, Eigen::RowMajor> rows;

  int rows_begin(int stage) const {
    return stage == 0 ? 0 : stages[static_cast<std::size_t>(stage - 1)].rows_end;
  }
  int row_count() const { return rows_begin(stage_count); }
};

/// Derivatives at the chart's base point, by the chosen method; both agree to rounding.
void linearize(const Scene& scene, const PathTopology& topology, const Chart& chart,
               DerivativeMethod method, const DerivativeRequest& request, Linearization& result);

/// By Jets that are seeded afresh at each vertex.
void linearize_by_jets(const Scene& scene, const PathTopology& topology, const Chart& chart,
                       const DerivativeRequest& request, Linearization& result);

/// By hand: hand_derivatives.h.
void linearize_by_hand(const Scene& scene, const PathTopology& topology, const Chart& chart,
                       const DerivativeRequest& request, Linearization& result);

/// The residual rows over all coordinates of the path, sqrt(w)/3 dr / d delta. (residuals x d)
using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor,
                               kMaxResiduals, kMaxDimension>;
Jacobian jacobian(const Linearization& path);

/// Q = J^T J + floor, dense and symmetric. (d x d)
Matrix constraint_matrix(const Linearization& path);

/// Q x, in O(length) unless there is a light side. (d)
Vector apply_constraints(const Linearization& path, const Vector& x);

}  // namespace driftlight
