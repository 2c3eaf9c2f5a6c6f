// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: a walk in double records the vertices of the path (hand_path.h),
/// and two sweeps chain the rules of hand_rules.h: the gradient (hand_gradient.h) and the stages
/// (hand_stages.h).
#pragma once

#include "driftlight/hand_gradient.h"
#include "driftlight/hand_stages.h"

namespace driftlight {

/// linearize by the given rules.
template <class Rules>
void linearize_by_rules(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        const DerivativeRequest& request, Linearization& result) {
  hand::Recorder<Rules> path(topology, scene.camera().origin, request.gradient);
  const auto blocks = [&](int k) -> const Vec3d& { return chart.block(k).point; };
  walk<double>(scene, topology, blocks, path);
  result.block_count = chart.block_count();
  result.has_light_side = topology.has_light_side();
  result.stage_count = 0;
  result.gradient.resize(0);
  if (request.gradient) hand::GradientSweep<Rules>(scene, topology, chart, path, result).gradient();
  if (request.constraints) hand::StageSweep<Rules>(scene, topology, chart, path, result).stages();
}

}  // namespace driftlight
