// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <numeric>
#include <vector>

namespace driftlight {

/// Indices of `count` of the weights, in order, each as often as is proportional to it up to one:
/// those where the running sum passes (i + offset) / count of the whole, offset uniform in (0, 1).
/// Their sum must be positive.
inline std::vector<std::size_t> systematic_resampling(const std::vector<double>& weights, int count,
                                                      double offset) {
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  const auto size = static_cast<std::size_t>(count);
  std::vector<std::size_t> result;
  result.reserve(size);
  double cumulative = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    cumulative += weights[i];
    const double reached = cumulative / sum * count;
    while (result.size() < size && static_cast<double>(result.size()) + offset < reached)
      result.push_back(i);
  }
  // Rounding of the last sum may leave one out.
  while (result.size() < size) result.push_back(result.back());
  return result;
}

}  // namespace driftlight
