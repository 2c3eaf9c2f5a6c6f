// SPDX-License-Identifier: Apache-2.0
#include "gradient_cache.h"

#include <array>
#include <functional>
#include <nanoflann.hpp>
#include <optional>
#include <utility>

namespace driftlight {
namespace {

constexpr std::size_t kNearest = 5;
/// Over the root of the dimension.
constexpr double kRadius = 0.01;

using Places = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Places places_of(const std::vector<GradientCache::Point>& points) {
  Places places(static_cast<Eigen::Index>(points.size()), points.front().numbers.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    places.row(static_cast<Eigen::Index>(i)) = points[i].numbers.transpose();
  return places;
}

}  // namespace

/// The points of one strategy, of which there are some.
class GradientCache::Tree {
 public:
  explicit Tree(std::vector<Point> points)
      : points_(std::move(points)),
        places_(places_of(points_)),
        tree_(static_cast<int>(places_.cols()), std::cref(places_)) {}

  /// The mean of what is known near; none if nothing is.
  std::optional<GradientMoments> near(const Vector& numbers) const {
    std::array<Eigen::Index, kNearest> indices{};
    std::array<double, kNearest> squared_distances{};
    nanoflann::KNNResultSet<double, Eigen::Index> nearest(kNearest);
    nearest.init(indices.data(), squared_distances.data());
    // The search leaves out what is farther than the last place, which nothing has yet.
    squared_distances.back() = kRadius * kRadius * static_cast<double>(numbers.size());
    tree_.index->findNeighbors(nearest, numbers.data(), nanoflann::SearchParams());
    GradientMoments sum{Vector::Zero(numbers.size()), Vector::Zero(numbers.size())};
    double count = 0.0;
    for (std::size_t i = 0; i < nearest.size(); ++i) {
      const GradientMoments& moments = points_[static_cast<std::size_t>(indices[i])].moments;
      sum.direction += moments.direction;
      sum.square += moments.square;
      count += 1.0;
    }
    if (count == 0.0) return std::nullopt;
    return GradientMoments{sum.direction / count, sum.square / count};
  }

 private:
  std::vector<Point> points_;
  Places places_;
  nanoflann::KDTreeEigenMatrixAdaptor<Places> tree_;
};

GradientCache::GradientCache(const std::vector<Point>& points, const LmcOptions& options)
    : options_(options) {
  std::map<std::pair<int, int>, std::vector<Point>> by_strategy;
  for (const Point& point : points) {
    std::vector<Point>& of = by_strategy[{point.strategy.s, point.strategy.t}];
    if (of.size() < static_cast<std::size_t>(options.cache)) of.push_back(point);
  }
  for (auto& [strategy, of] : by_strategy) trees_[strategy] = std::make_unique<Tree>(std::move(of));
}

GradientCache::GradientCache(GradientCache&&) noexcept = default;
GradientCache::~GradientCache() = default;

GaussianStep GradientCache::step(const Strategy& strategy, const Vector& numbers) const {
  const auto tree = trees_.find({strategy.s, strategy.t});
  if (tree != trees_.end())
    if (const auto moments = tree->second->near(numbers)) return moments->step(options_);
  return GaussianStep::isotropic(static_cast<int>(numbers.size()), options_.sigma);
}

}  // namespace driftlight
