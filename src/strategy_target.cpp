// SPDX-License-Identifier: Apache-2.0
#include "strategy_target.h"

#include <cmath>

namespace driftlight {
namespace {

/// Hands to found(path, luminance) what has been put on the film.
template <class Found>
struct StrategySink {
  Vec2d film;
  int min_edges;
  PrimaryPlace& place;
  std::uint64_t& non_finite;
  const Found& found;

  void add(const Rgbd& value, const FoundPath& path) { splat(film, value, path); }
  void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
    if (path.s + path.t - 1 < min_edges) return;
    const double y = luminance(value);
    if (y == 0.0) return;
    if (!std::isfinite(y)) {
      ++non_finite;
      return;
    }
    place.splats.push_back({at, value / y, y});
    place.target += y;
    found(path, y);
  }
};

/// Calls trace(film, numbers, sink) with an empty place.
template <class Found, class Trace>
void read(const StrategyNumbers& from, int min_edges, PrimaryPlace& place,
          std::uint64_t& non_finite, const Found& found, const Trace& trace) {
  place.splats.clear();
  place.target = 0.0;
  StrategyNumbers::Reader sensor_numbers = from.sensor();
  StrategyNumbers::Reader light_numbers = from.light();
  StrategyNumbers::Reader connection_numbers = from.connection();
  Rng sensor(sensor_numbers);
  Rng light(light_numbers);
  Rng connection(connection_numbers);
  const Vec2d film = sensor.uniform2();
  StrategySink<Found> sink{film, min_edges, place, non_finite, found};
  trace(film, SampleNumbers{sensor, light, connection}, sink);
}

}  // namespace

StrategyTarget::StrategyTarget(const Scene& scene, const EmissionGuide& unguided, int min_edges,
                               int max_edges)
    : scene_(scene),
      tracer_(scene, unguided, MisHeuristic::Balance, max_edges, Roulette::Off),
      function_(scene, unguided),
      min_edges_(min_edges) {}

std::optional<PrimaryPath> StrategyTarget::operator()(const StrategyNumbers& numbers,
                                                      const Strategy& strategy,
                                                      PrimaryPlace& place) {
  std::optional<PrimaryPath> result;
  read(
      numbers, min_edges_, place, non_finite_,
      [&](const FoundPath& path, double) { result = primary_path(scene_, path); },
      [&](const Vec2d& film, const SampleNumbers& from, auto& sink) {
        tracer_.sample_strategy(strategy.s, strategy.t, film, from, sink);
      });
  return result;
}

std::optional<StrategyTarget::Choice> StrategyTarget::sample(const StrategyNumbers& numbers,
                                                             Rng& rng, PrimaryPlace& place) {
  std::optional<Choice> result;
  read(
      numbers, min_edges_, place, non_finite_,
      [&](const FoundPath& path, double y) {
        // The sum so far has the share y of this one; that is the probability of taking it.
        if (!result || rng.uniform() * place.target < y)
          result = Choice{primary_path(scene_, path), place.splats.size() - 1};
      },
      [&](const Vec2d& film, const SampleNumbers& from, auto& sink) {
        tracer_.sample(film, from, sink);
      });
  return result;
}

}  // namespace driftlight
