// SPDX-License-Identifier: Apache-2.0
#include "derivatives/float_jets.h"
#include "derivatives/passes.h"

namespace driftlight::bench {

void gradient_stride4_float(const Scene& scene, const PathTopology& topology, const Chart& chart,
                            Vector& gradient) {
  gradient_in_passes<float, 4>(scene, topology, chart, gradient);
}

}  // namespace driftlight::bench
