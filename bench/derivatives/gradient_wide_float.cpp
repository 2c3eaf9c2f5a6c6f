// SPDX-License-Identifier: Apache-2.0
#include "derivatives/float_jets.h"
#include "derivatives/passes.h"

namespace driftlight::bench {

void gradient_wide_float(const Scene& scene, const PathTopology& topology, const Chart& chart,
                         Vector& gradient) {
  with_width(chart.dimension(), [&](auto width) {
    gradient_in_passes<float, width()>(scene, topology, chart, gradient);
  });
}

}  // namespace driftlight::bench
