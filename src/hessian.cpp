// SPDX-License-Identifier: Apache-2.0
#include "driftlight/hessian.h"

#include "driftlight/contribution.h"
#include "nested_jets.h"

namespace driftlight {

Matrix hessian(const Scene& scene, const PathTopology& topology, const Chart& chart,
               const Vector& delta) {
  const int d = chart.dimension();
  Eigen::Matrix<double, kMaxDimension, kMaxDimension> padded;
  padded.setZero();
  for (int outer = 0; outer < d; outer += kNestedWidth) {
    for (int inner = outer; inner < d; inner += kNestedWidth) {
      const auto blocks = [&](int k) {
        return chart.retract(k, nested_jet(delta[2 * k], 2 * k, outer, inner),
                             nested_jet(delta[2 * k + 1], 2 * k + 1, outer, inner));
      };
      ContributionVisitor<NestedJet> visitor;
      walk<NestedJet>(scene, topology, blocks, visitor);
      const NestedJet log_target = visitor.log_target();
      for (int i = 0; i < kNestedWidth; ++i)
        for (int j = 0; j < kNestedWidth; ++j) {
          padded(outer + i, inner + j) = -log_target.v[i].v[j];
          padded(inner + j, outer + i) = -log_target.v[i].v[j];
        }
    }
  }
  return padded.topLeftCorner(d, d);
}

}  // namespace driftlight
