// SPDX-License-Identifier: Apache-2.0
/// Jets of Jets of some coordinates: second derivatives, a block of them in each walk.
#pragma once

#include "driftlight/phase_space.h"

namespace driftlight {

/// Coordinates of a block: narrow Jets of Jets compile quickly and fit into registers.
inline constexpr int kNestedWidth = 4;
static_assert(kMaxDimension % kNestedWidth == 0);

using InnerJet = ceres::Jet<double, kNestedWidth>;
using NestedJet = ceres::Jet<InnerJet, kNestedWidth>;

/// Coordinate j: outer derivatives from `outer` on, inner ones from `inner` on.
inline NestedJet nested_jet(double x, int j, int outer, int inner) {
  NestedJet jet{InnerJet(x)};
  if (j >= inner && j < inner + kNestedWidth) jet.a.v[j - inner] = 1.0;
  if (j >= outer && j < outer + kNestedWidth) jet.v[j - outer] = InnerJet(1.0);
  return jet;
}

}  // namespace driftlight
