// SPDX-License-Identifier: Apache-2.0
#include "driftlight/contribution.h"

namespace driftlight {

Contribution contribution(const Scene& scene, const PathTopology& topology,
                          const PathCoordinates& coordinates) {
  ContributionVisitor<double> visitor;
  walk<double>(scene, topology, coordinates, visitor);
  const double light = luminance(visitor.color());
  return {visitor.log_scale() + std::log(light), visitor.color() / light};
}

}  // namespace driftlight
