// SPDX-License-Identifier: Apache-2.0
/// Precision matrices Q of a step that are dense: those of all preconditioners but Identity, whose
/// Q is I / 9, and Constraints, whose Q is factorised stage by stage (factor.h).
///   Diagonal  the diagonal of 1/9 sum J^T C^-1 J + floor I, Q of the constraints (E63.13)
///   Hessian   |H| / 9 + floor I, H the Hessian of U, |H| the same with the absolute values of its
///             eigenvalues. Where f is Gaussian in the residuals of the constraints, H is
///             sum J^T C^-1 J, and Q that of Constraints.
/// Both depend on the choice of the chart's tangents, the first a lot; charts are functions of the
/// state, so densities of steps are exact all the same.
#pragma once

#include "driftlight/linearization.h"

namespace driftlight {

/// Of PreconditionerKind::Diagonal, from the constraints of the path. (d x d)
Matrix diagonal_precision(const Linearization& path);

/// Of PreconditionerKind::Hessian at the tangent coordinates `delta` of the chart; not finite where
/// second derivatives are not. (d x d)
Matrix hessian_precision(const Scene& scene, const PathTopology& topology, const Chart& chart,
                         const Vector& delta, double floor = kConstraintFloor);

/// div(Q^-1), as divergence() of divergence.h has it, of these two kinds, by central differences of
/// the whole matrix: 2 d of them. Apertures are left out. Non-finite where a displaced path does
/// not exist.
Vector dense_divergence(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        PreconditionerKind kind, double floor = kConstraintFloor);

}  // namespace driftlight
