// SPDX-License-Identifier: Apache-2.0
/// The divergence of the inverse constraint matrix, by central differences.
#pragma once

#include "driftlight/aperture.h"
#include "driftlight/linearization.h"

namespace driftlight {

/// div(Q^-1)_i = sum_j d(Q^-1)_ij / d delta_j at the chart's base point:
///   div(Q^-1) = -Q^-1 sum_j (d_j Q) Q^-1 e_j,
/// d_j Q by central differences in the chart, 2 d linearizations in all. Each needs Q only as it
/// acts on one vector, so that all of it costs O(d length). Non-finite where a displaced path does
/// not exist or Q cannot be factorised. The apertures of the path (none: without that constraint)
/// keep their widths, axes and distances. `floor` is that of Linearization.
Vector divergence(const Scene& scene, const PathTopology& topology, const Chart& chart,
                  DerivativeMethod method = DerivativeMethod::Hand, const Apertures& apertures = {},
                  double floor = kConstraintFloor);

}  // namespace driftlight
