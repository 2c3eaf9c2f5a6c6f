// SPDX-License-Identifier: Apache-2.0
#include "driftlight/hand_derivatives.h"

namespace driftlight {

void linearize_by_hand(const Scene& scene, const PathTopology& topology, const Chart& chart,
                       const DerivativeRequest& request, Linearization& result) {
  linearize_by_rules<HandRules>(scene, topology, chart, request, result);
}

}  // namespace driftlight
