// SPDX-License-Identifier: Apache-2.0
#include "pilot.h"

#include <tbb/parallel_for.h>

#include <cmath>

#include "bidirectional_tracer.h"
#include "light_rate.h"

namespace driftlight {
namespace {

constexpr int kRounds = 4;
constexpr std::uint64_t kTask = 256;

/// What samples have found.
struct Found {
  std::vector<FilmValue> film;
  std::vector<EmissionGuide::Record> emissions;
};

/// Collects the luminances of what a sample finds, and how much of it by its light subpath.
class PilotSink {
 public:
  PilotSink(const Vec2d& film, const BrightnessMap& brightness, std::vector<FilmValue>& found)
      : film_(film), brightness_(brightness), found_(found) {}

  void add(const Rgbd& value, const FoundPath& path) { splat(film_, value, path); }
  void splat(const Vec2d& film, const Rgbd& value, const FoundPath& path) {
    const double y = luminance(value);
    if (!std::isfinite(y) || !(y > 0.0)) return;
    found_.push_back({film, y});
    if (path.s > 1) from_light_ += y / brightness_(film);
  }

  double from_light() const { return from_light_; }

 private:
  Vec2d film_;
  const BrightnessMap& brightness_;
  std::vector<FilmValue>& found_;
  double from_light_ = 0;
};

/// Samples first .. first + kTask - 1.
Found run_task(const Scene& scene, const Pilot& before, int max_depth, std::uint64_t seed,
               std::uint64_t first) {
  Found found;
  BidirectionalTracer tracer(scene, before.guide, MisHeuristic::Balance, max_depth);
  for (std::uint64_t i = first; i < first + kTask; ++i) {
    Rng rng(seed, Stream::Pilot, i);
    const Vec2d film = rng.uniform2();
    PilotSink sink(film, before.brightness, found.film);
    tracer.sample(film, rng, sink);
    if (!(sink.from_light() > 0.0)) continue;
    const Emission& ray = tracer.emission();
    const std::uint32_t emitter = ray.end.emitter;
    found.emissions.push_back({emitter, emission_sample(scene, emitter, ray.origin, ray.direction),
                               sink.from_light(),
                               before.guide.factor(emitter, ray.origin, ray.direction)});
  }
  return found;
}

}  // namespace

Pilot run_pilot(const Scene& scene, const LangevinOptions& options, std::uint64_t seed) {
  Pilot pilot{BrightnessMap({}, 1.0), EmissionGuide(scene)};
  const auto last = static_cast<std::uint64_t>(options.redistribution.pilot);
  std::uint64_t first = 0;
  for (int round = kRounds - 1; round >= 0; --round) {
    const std::uint64_t tasks = std::max<std::uint64_t>(1, (last >> round) / kTask);
    std::vector<Found> found(tasks);
    tbb::parallel_for(std::uint64_t{0}, tasks, [&](std::uint64_t i) {
      found[i] = run_task(scene, pilot, options.max_depth, seed, first + i * kTask);
    });
    first += tasks * kTask;
    Found all;
    for (const Found& part : found) {
      all.film.insert(all.film.end(), part.film.begin(), part.film.end());
      all.emissions.insert(all.emissions.end(), part.emissions.begin(), part.emissions.end());
    }
    pilot.brightness = BrightnessMap(all.film, static_cast<double>(tasks * kTask));
    if (options.redistribution.guide) pilot.guide = EmissionGuide(scene, all.emissions);
  }
  choose_light_rate(scene, options, seed, pilot);
  return pilot;
}

}  // namespace driftlight
