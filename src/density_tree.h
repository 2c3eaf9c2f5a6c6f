// SPDX-License-Identifier: Apache-2.0
/// A learned density on the unit cube: piecewise constant on the leaves of a kd-tree.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "driftlight/random.h"

namespace driftlight {

/// A point of the unit cube, drawn with the density g, where an estimator had the value c.
struct CubeRecord {
  std::array<float, 4> at;
  float moment;  ///< c^2 g: sums of it over a box estimate the integral of the second moment there
};

class DensityTree {
 public:
  using Point = std::array<double, 4>;
  using Axes = std::array<bool, 4>;

  /// 1 everywhere.
  DensityTree() : nodes_(1) {}
  /// In proportion to the root of the second moment, which is the density of least variance; a
  /// fraction `uniform` of it stays spread evenly. Only the given axes are told apart. The records
  /// are reordered.
  DensityTree(std::vector<CubeRecord>& records, const Axes& axes, double uniform);

  bool is_uniform() const { return nodes_.size() == 1; }
  /// Density at a point; coordinates beyond [0, 1] count as 0 or 1.
  double density(const Point& point) const;
  /// Turns uniform numbers into a point of this density.
  Point sample(Point u) const;
  /// The integral of the root of the second moment, before normalisation.
  double mass() const { return mass_; }

 private:
  /// A leaf, or two halves of its box along an axis.
  struct Node {
    std::int32_t children = 0;  ///< index of the first; 0: a leaf
    std::int32_t axis = 0;
    double lower = 0.5;  ///< probability of the lower half
  };
  class Builder;

  std::vector<Node> nodes_;
  double mass_ = 0;
};

}  // namespace driftlight
