// SPDX-License-Identifier: Apache-2.0
#include "strategy_target.h"

#include <cmath>

namespace driftlight {
namespace {

struct StrategySink {
  const Scene& scene;
  Vec2d film;
  double factor;
  PrimaryPlace& place;
  std::optional<PrimaryPath>& found;
  std::uint64_t& non_finite;

  void add(const Rgbd& value, const FoundPath& path) { splat(film, value, path); }
  void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
    const double y = luminance(value);
    if (y == 0.0) return;
    if (!std::isfinite(y)) {
      ++non_finite;
      return;
    }
    place.splats.push_back({at, value / y, factor * y});
    place.target = factor * y;
    found = primary_path(scene, path);
  }
};

}  // namespace

StrategyTarget::StrategyTarget(const Scene& scene, const EmissionGuide& unguided, int max_edges)
    : scene_(scene),
      tracer_(scene, unguided, MisHeuristic::Balance, max_edges, Roulette::Off),
      function_(scene, unguided) {}

std::optional<PrimaryPath> StrategyTarget::operator()(const StrategyNumbers& numbers,
                                                      PrimaryPlace& place) {
  place.splats.clear();
  place.target = 0.0;
  StrategyNumbers::Reader sensor_numbers = numbers.sensor();
  StrategyNumbers::Reader light_numbers = numbers.light();
  StrategyNumbers::Reader connection_numbers = numbers.connection();
  Rng sensor(sensor_numbers);
  Rng light(light_numbers);
  Rng connection(connection_numbers);
  const Vec2d film = sensor.uniform2();
  const auto [s, t] = numbers.strategy();
  std::optional<PrimaryPath> found;
  StrategySink sink{scene_, film, static_cast<double>(s + t), place, found, non_finite_};
  tracer_.sample_strategy(s, t, film, SampleNumbers{sensor, light, connection}, sink);
  return found;
}

}  // namespace driftlight
