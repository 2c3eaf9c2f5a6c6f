// SPDX-License-Identifier: Apache-2.0
#include "path_density.h"

#include "density_visitor.h"

namespace driftlight {

StrategyDensities strategy_densities(const Scene& scene, const EmissionGuide& guide,
                                     const PathTopology& topology,
                                     const PathCoordinates& coordinates) {
  DensityVisitor<double> path(scene, guide, topology);
  walk<double>(scene, topology, coordinates, path);
  return {densities_by_light_vertices(path, topology, scene.emitter_probability(topology.emitter))};
}

}  // namespace driftlight
