// SPDX-License-Identifier: Apache-2.0
#include "derivatives/passes.h"

namespace driftlight::bench {

void gradient_stride4(const Scene& scene, const PathTopology& topology, const Chart& chart,
                      Vector& gradient) {
  gradient_in_passes<double, 4>(scene, topology, chart, gradient);
}

}  // namespace driftlight::bench
