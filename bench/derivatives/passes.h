// SPDX-License-Identifier: Apache-2.0
/// Gradients by passes of Jet<Real, N> over the whole path.
#pragma once

#include <algorithm>
#include <type_traits>

#include "derivatives/variants.h"
#include "driftlight/contribution.h"

namespace driftlight::bench {

/// The blocks of a path at the base point of its chart; coordinates [first, first + N) are seeded.
template <class Real, int N>
class SeededBlocks {
 public:
  using T = ceres::Jet<Real, N>;

  SeededBlocks(const Chart& chart, int first) : chart_(chart), first_(first) {}

  Vec3<T> operator()(int k) const {
    const Chart::Block& block = chart_.block(k);
    Vec3<T> v = constant<T>(block.point);
    const int column = 2 * k - first_;
    if (column < 0 || column >= N) return v;
    for (int i = 0; i < 3; ++i) {
      v[i].v[column] = static_cast<Real>(block.t[i]);
      v[i].v[column + 1] = static_cast<Real>(block.b[i]);
    }
    return v;
  }

 private:
  const Chart& chart_;
  int first_;
};

/// ceil(d / N) walks.
template <class Real, int N>
void gradient_in_passes(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        Vector& gradient) {
  using T = ceres::Jet<Real, N>;
  const int d = chart.dimension();
  gradient.resize(d);
  for (int first = 0; first < d; first += N) {
    ContributionVisitor<T> visitor;
    walk<T>(scene, topology, SeededBlocks<Real, N>(chart, first), visitor);
    const T log_target = visitor.log_target();
    for (int i = 0; i < std::min(N, d - first); ++i)
      gradient[first + i] = -static_cast<double>(log_target.v[i]);
  }
}

/// Calls f with the width of the one pass that covers d coordinates, as an integral_constant.
template <class F>
void with_width(int d, const F& f) {
  if (d <= 4)
    f(std::integral_constant<int, 4>{});
  else if (d <= 8)
    f(std::integral_constant<int, 8>{});
  else if (d <= 16)
    f(std::integral_constant<int, 16>{});
  else
    f(std::integral_constant<int, 24>{});
}

/// Most coordinates that with_width covers.
inline constexpr int kMaxWidth = 24;

}  // namespace driftlight::bench
