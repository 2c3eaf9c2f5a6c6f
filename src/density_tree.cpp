// SPDX-License-Identifier: Apache-2.0
#include "density_tree.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace driftlight {
namespace {

constexpr int kMostDepth = 24;
/// Fewer records than this in a box tell nothing about how they are spread in it.
constexpr std::size_t kLeastRecords = 32;
/// A split must lower the sum of roots by so much to be worth it.
constexpr double kWorthwhile = 0.97;
constexpr int kBins = 4;

struct Box {
  std::array<float, 4> low{0, 0, 0, 0};
  std::array<float, 4> size{1, 1, 1, 1};

  double volume() const {
    double v = 1;
    for (const float s : size) v *= static_cast<double>(s);
    return v;
  }
};

double sum_of(std::span<const CubeRecord> records) {
  double sum = 0;
  for (const CubeRecord& r : records) sum += static_cast<double>(r.moment);
  return sum;
}

}  // namespace

class DensityTree::Builder {
 public:
  Builder(std::vector<Node>& nodes, const Axes& axes) : nodes_(nodes), axes_(axes) {}

  /// The mass of the subtree: the integral over its box of the root of the second moment, taken as
  /// constant on leaves, sqrt(volume * integral).
  double build(std::size_t node, std::span<CubeRecord> records, const Box& box, int depth) {
    const double leaf_mass = std::sqrt(box.volume() * sum_of(records));
    const int axis = depth < kMostDepth ? best_axis(records, box, leaf_mass) : -1;
    if (axis < 0) return leaf_mass;
    const auto a = static_cast<std::size_t>(axis);
    const float middle = box.low[a] + 0.5F * box.size[a];
    const auto upper = std::partition(records.begin(), records.end(),
                                      [&](const CubeRecord& r) { return r.at[a] < middle; });
    const auto count = static_cast<std::size_t>(upper - records.begin());
    Box low = box;
    low.size[a] *= 0.5F;
    Box high = low;
    high.low[a] = middle;
    const std::size_t children = nodes_.size();
    nodes_.resize(children + 2);
    const double below = build(children, records.first(count), low, depth + 1);
    const double above = build(children + 1, records.subspan(count), high, depth + 1);
    nodes_[node] = {static_cast<std::int32_t>(children), axis, below / (below + above)};
    return below + above;
  }

 private:
  /// The axis whose quarters differ most; -1 if none is worth a split. Quarters, since halves look
  /// alike where something lies in the middle.
  int best_axis(std::span<const CubeRecord> records, const Box& box, double leaf_mass) const {
    if (records.size() < kLeastRecords || !(leaf_mass > 0.0)) return -1;
    int best = -1;
    double least = kWorthwhile * leaf_mass;
    for (std::size_t a = 0; a < axes_.size(); ++a) {
      if (!axes_[a]) continue;
      std::array<double, kBins> bins{};
      for (const CubeRecord& r : records) {
        const float x = (r.at[a] - box.low[a]) / box.size[a];
        const int bin = std::clamp(static_cast<int>(x * kBins), 0, kBins - 1);
        bins[static_cast<std::size_t>(bin)] += static_cast<double>(r.moment);
      }
      double mass = 0;
      for (const double b : bins) mass += std::sqrt(box.volume() / kBins * b);
      if (!(mass < least)) continue;
      least = mass;
      best = static_cast<int>(a);
    }
    return best;
  }

  std::vector<Node>& nodes_;
  Axes axes_;
};

DensityTree::DensityTree(std::vector<CubeRecord>& records, const Axes& axes, double uniform)
    : nodes_(1) {
  mass_ = Builder(nodes_, axes).build(0, records, Box{}, 0);
  // Mixed with the uniform density, node by node: the lower half of a node of mass m and volume v
  // has (1 - e) m_lower + e v / 2 of (1 - e) m + e v.
  struct Entry {
    std::size_t node;
    double mass, volume;
  };
  std::vector<Entry> stack{{0, 1.0, 1.0}};
  while (!stack.empty()) {
    const auto [index, mass, volume] = stack.back();
    stack.pop_back();
    Node& node = nodes_[index];
    if (node.children == 0) continue;
    const double lower = mass * node.lower;
    const auto child = static_cast<std::size_t>(node.children);
    stack.push_back({child, lower, 0.5 * volume});
    stack.push_back({child + 1, mass - lower, 0.5 * volume});
    node.lower = ((1.0 - uniform) * lower + uniform * 0.5 * volume) /
                 ((1.0 - uniform) * mass + uniform * volume);
  }
}

double DensityTree::density(const Point& point) const {
  Point x = point;
  double density = 1;
  const Node* node = nodes_.data();
  while (node->children != 0) {
    double& coordinate = x[static_cast<std::size_t>(node->axis)];
    const bool upper = coordinate >= 0.5;
    coordinate = 2.0 * coordinate - (upper ? 1.0 : 0.0);
    density *= 2.0 * (upper ? 1.0 - node->lower : node->lower);
    node = nodes_.data() + node->children + (upper ? 1 : 0);
  }
  return density;
}

DensityTree::Point DensityTree::sample(Point u) const {
  Point low{};
  Point size{1, 1, 1, 1};
  const Node* node = nodes_.data();
  while (node->children != 0) {
    const auto a = static_cast<std::size_t>(node->axis);
    const bool upper = u[a] >= node->lower;
    const double start = upper ? node->lower : 0.0;
    const double share = upper ? 1.0 - node->lower : node->lower;
    u[a] = std::min((u[a] - start) / share, 1.0 - 0x1p-53);
    size[a] *= 0.5;
    if (upper) low[a] += size[a];
    node = nodes_.data() + node->children + (upper ? 1 : 0);
  }
  for (std::size_t a = 0; a < low.size(); ++a) low[a] += size[a] * u[a];
  return low;
}

}  // namespace driftlight
