// SPDX-License-Identifier: Apache-2.0
#include "derivatives/passes.h"

namespace driftlight::bench {

void gradient_wide(const Scene& scene, const PathTopology& topology, const Chart& chart,
                   Vector& gradient) {
  with_width(chart.dimension(), [&](auto width) {
    gradient_in_passes<double, width()>(scene, topology, chart, gradient);
  });
}

}  // namespace driftlight::bench
