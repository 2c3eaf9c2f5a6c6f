// SPDX-License-Identifier: Apache-2.0
#include "primary_target.h"

#include <cmath>

namespace driftlight {
namespace {

struct Sink {
  std::vector<PrimarySplat>& splats;
  Vec2d film;
  int min_edges;
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
    splats.push_back({at, value / y, y});
  }
};

}  // namespace

PrimaryPoint::PrimaryPoint(const PrimaryOptions& options, std::uint64_t seed, Stream purpose,
                           std::uint64_t index)
    : sensor(options, Rng(seed, purpose, 3 * index)),
      light(options, Rng(seed, purpose, 3 * index + 1)),
      connection(options, Rng(seed, purpose, 3 * index + 2)) {}

PrimaryTarget::PrimaryTarget(const Scene& scene, const EmissionGuide& unguided, int min_edges,
                             int max_edges)
    : tracer_(scene, unguided, MisHeuristic::Balance, max_edges), min_edges_(min_edges) {}

double PrimaryTarget::operator()(PrimaryPoint& point, std::vector<PrimarySplat>& splats) {
  splats.clear();
  Rng sensor(point.sensor);
  Rng light(point.light);
  Rng connection(point.connection);
  const SampleNumbers numbers{sensor, light, connection};
  const Vec2d film = sensor.uniform2();
  Sink sink{splats, film, min_edges_, non_finite_};
  tracer_.sample(film, numbers, sink);
  double sum = 0.0;
  for (const PrimarySplat& splat : splats) sum += splat.luminance;
  return sum;
}

}  // namespace driftlight
