// SPDX-License-Identifier: Apache-2.0
/// Derivatives of a path in ways that the library does not use, for comparison. Each is a
/// translation unit of its own, so that its compile time and its code can be measured (cost.sh).
#pragma once

#include "driftlight/gradient.h"

namespace driftlight::bench {

/// grad U at the chart's base point.
using GradientFunction = void(const Scene& scene, const PathTopology& topology, const Chart& chart,
                              Vector& gradient);

/// One pass of Jet<double, N>, N the first of 4, 8, 16, 24 that holds all coordinates.
GradientFunction gradient_wide;
/// Passes of Jet<double, 4> and of Jet<double, 8>.
GradientFunction gradient_stride4;
GradientFunction gradient_stride8;
/// The same with Jet<float, N>; the walk itself is in float too.
GradientFunction gradient_wide_float;
GradientFunction gradient_stride4_float;
GradientFunction gradient_stride8_float;
/// Central differences of the value, two for each coordinate.
GradientFunction gradient_differences;

/// grad U and the lower triangle of Q, in one pass as gradient_wide.
void gradient_q_wide(const Scene& scene, const PathTopology& topology, const Chart& chart,
                     PathDerivatives& result);

}  // namespace driftlight::bench
