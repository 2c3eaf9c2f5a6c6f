// SPDX-License-Identifier: Apache-2.0
#include "derivatives/variants.h"
#include "driftlight/contribution.h"

namespace driftlight::bench {

void gradient_differences(const Scene& scene, const PathTopology& topology, const Chart& chart,
                          Vector& gradient) {
  // About where the rounding of U and the curvature of its slope weigh alike.
  constexpr double kStep = 1e-5;
  const int d = chart.dimension();
  gradient.resize(d);
  PathCoordinates coordinates;
  for (int k = 0; k < chart.block_count(); ++k) coordinates(k) = chart.block(k).point;
  const auto value_at = [&](int k, double d0, double d1) {
    coordinates(k) = chart.retract(k, d0, d1);
    ContributionVisitor<double> visitor;
    walk<double>(scene, topology, coordinates, visitor);
    return visitor.log_target();
  };
  for (int k = 0; k < chart.block_count(); ++k) {
    gradient[2 * k] = (value_at(k, -kStep, 0.0) - value_at(k, kStep, 0.0)) / (2.0 * kStep);
    gradient[2 * k + 1] = (value_at(k, 0.0, -kStep) - value_at(k, 0.0, kStep)) / (2.0 * kStep);
    coordinates(k) = chart.block(k).point;
  }
}

}  // namespace driftlight::bench
