// SPDX-License-Identifier: Apache-2.0
#include "primary_target.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

struct Sink {
  std::vector<PrimarySplat>& splats;
  Vec2d film;
  int min_edges;
  double factor;
  std::uint64_t& non_finite;

  void add(const Rgbd& value, const FoundPath& path) { splat(film, value, path); }
  void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
    if (path.s + path.t - 1 < min_edges) return;
    const double y = luminance(value);
    if (y == 0.0) return;
    if (!std::isfinite(y)) {
      ++non_finite;
      return;
    }
    splats.push_back({at, value / y, factor * y});
  }
};

}  // namespace

PrimaryPoint::PrimaryPoint(const PrimaryOptions& options, std::uint64_t seed, Stream purpose,
                           std::uint64_t index)
    : sensor(options, Rng(seed, purpose, 4 * index)),
      light(options, Rng(seed, purpose, 4 * index + 1)),
      connection(options, Rng(seed, purpose, 4 * index + 2)),
      strategy(options, Rng(seed, purpose, 4 * index + 3)) {}

PrimaryTarget::PrimaryTarget(const Scene& scene, const EmissionGuide& unguided,
                             Strategies strategies, int min_edges, int max_edges)
    : tracer_(scene, unguided, MisHeuristic::Balance, max_edges,
              strategies == Strategies::All ? Roulette::On : Roulette::Off),
      strategies_(strategies),
      min_edges_(min_edges) {}

double PrimaryTarget::operator()(PrimaryPoint& point, std::vector<PrimarySplat>& splats) {
  splats.clear();
  Rng sensor(point.sensor);
  Rng light(point.light);
  Rng connection(point.connection);
  const SampleNumbers numbers{sensor, light, connection};
  const Vec2d film = sensor.uniform2();
  if (strategies_ == Strategies::All) {
    Sink sink{splats, film, min_edges_, 1.0, non_finite_};
    tracer_.sample(film, numbers, sink);
  } else {
    const int count = point.edges + 1;
    const int s = std::min(static_cast<int>(count * point.strategy.next()), point.edges);
    Sink sink{splats, film, min_edges_, static_cast<double>(count), non_finite_};
    tracer_.sample_strategy(s, count - s, film, numbers, sink);
  }
  double sum = 0.0;
  for (const PrimarySplat& splat : splats) sum += splat.luminance;
  return sum;
}

}  // namespace driftlight
