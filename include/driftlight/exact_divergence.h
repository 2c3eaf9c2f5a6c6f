// SPDX-License-Identifier: Apache-2.0
/// The divergence of Q^-1 without differences: the truth against which divergence() of
/// divergence.h is measured.
#pragma once

#include "driftlight/gradient.h"
#include "driftlight/phase_space.h"

namespace driftlight {

/// div(Q^-1)_i = sum_j d(Q^-1)_ij / d delta_j at the chart's base point, dQ^-1 = -Q^-1 dQ Q^-1,
/// with exact second derivatives of the residuals. With P = Q^-1 and, for each residual of
/// precision w, J its gradient and H its Hessian,
///   9 dQ_ij / d delta_k = sum dw_k J_i J_j + w (H_ik J_j + J_i H_jk),
///   9 sum_jk dQ_ij/d delta_k P_jk = sum J_i (dw.y + w tr(H P)) + w (H y)_i,   y = P J,
///   div(Q^-1) = -P times that / 9.
/// H comes from Jets of Jets, a block of 4 x 4 coordinates in each walk. Some tens of times as slow
/// as divergence(), whose `floor` is this one. Non-finite where Q has no inverse.
Vector exact_divergence(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        double floor = kConstraintFloor);

}  // namespace driftlight
