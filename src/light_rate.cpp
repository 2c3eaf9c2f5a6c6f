// SPDX-License-Identifier: Apache-2.0
#include "light_rate.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "bidirectional_tracer.h"

namespace driftlight {
namespace {

constexpr std::uint64_t kTask = 256;
/// Samples of the pilot's last round for each pair of these.
constexpr std::uint64_t kFewer = 16;
constexpr std::array<double, 3> kRates{1.0, 1.0 / 4, 1.0 / 16};
/// A lower rate must promise to be better by this factor: what it makes rarer the pilot may have
/// missed, and chains may take more of the time than samples.
constexpr double kWorth = 1.5;
/// Where chains take over.
constexpr double kBright = 8;
/// What a connection costs in rays of a subpath.
constexpr double kConnectionCost = 0.5;

/// Whose square is the noise of a path of weight w.
double noise_of(double w) { return std::sqrt(w < kBright ? w * w : kBright * (2.0 * w - kBright)); }

/// What a sample with a light subpath finds, by weights for one rate.
struct Sums {
  double sensor = 0;   ///< A
  double light = 0;    ///< B
  double splats2 = 0;  ///< sum b^2

  double mean(double rate) const { return sensor + rate * light; }
  double square(double rate) const {
    return sqr(sensor) + rate * (light * (2.0 * sensor + light) + splats2);
  }
};

struct Work {
  double sensor = 0;
  double light = 0;

  double at(double rate) const { return sensor + rate * light; }
  Work& operator+=(const Work& other) {
    sensor += other.sensor;
    light += other.light;
    return *this;
  }
};

/// What pairs of samples tell of all rates.
struct Judged {
  std::array<double, kRates.size()> noise{};
  Work work;

  Judged& operator+=(const Judged& other) {
    for (std::size_t k = 0; k < noise.size(); ++k) noise[k] += other.noise[k];
    work += other.work;
    return *this;
  }
  /// Noise times cost at rate k, up to a factor.
  double inefficiency(std::size_t k) const { return noise[k] * work.at(kRates[k]); }
};

/// Adds up what a sample finds.
class Sink {
 public:
  Sink(const Vec2d& film, const BrightnessMap& brightness) : film_(film), brightness_(brightness) {}

  void add(const Rgbd& value, const FoundPath& path) {
    (path.s > 1 ? sums_.light : sums_.sensor) += noise_at(film_, value);
  }
  void splat(const Vec2d& film, const Rgbd& value, const FoundPath&) {
    sums_.splats2 += sqr(noise_at(film, value));
  }

  const Sums& sums() const { return sums_; }

 private:
  double noise_at(const Vec2d& film, const Rgbd& value) const {
    const double y = luminance(value);
    return std::isfinite(y) ? noise_of(y / brightness_(film)) : 0.0;
  }

  Vec2d film_;
  const BrightnessMap& brightness_;
  Sums sums_;
};

/// Of the tracer's last sample, with a light subpath.
Work work_of(const BidirectionalTracer& tracer, int max_depth) {
  const int z = tracer.from_sensor().size();
  const int y = tracer.from_light().size();
  int connections = y;  // to the sensor
  for (int j = 0; j < y; ++j)
    for (int i = 0; i < z && i + j + 3 <= max_depth; ++i)
      if (tracer.from_sensor()[i].connects && tracer.from_light()[j].connects) ++connections;
  return {1.0 + (1.0 + kConnectionCost) * z, 1.0 + y + kConnectionCost * connections};
}

/// Pairs first .. first + kTask - 1.
Judged run_task(const Scene& scene, const Pilot& pilot, int max_depth, std::uint64_t seed,
                std::uint64_t first) {
  Judged judged;
  for (std::size_t k = 0; k < kRates.size(); ++k) {
    const EmissionGuide guide = pilot.guide.at_rate(kRates[k]);
    BidirectionalTracer tracer(scene, guide, MisHeuristic::Balance, max_depth);
    for (std::uint64_t i = first; i < first + kTask; ++i) {
      Rng rng(seed, Stream::LightRate, i);
      const Vec2d film = rng.uniform2();
      std::array<Sums, 2> pair;
      for (Sums& sums : pair) {
        Sink sink(film, pilot.brightness);
        tracer.sample(film, SampleNumbers{rng, rng, rng}, true, sink);
        sums = sink.sums();
        if (k == 0) judged.work += work_of(tracer, max_depth);
      }
      const auto& [a, b] = pair;
      judged.noise[k] +=
          0.5 * (a.square(kRates[k]) + b.square(kRates[k])) - a.mean(kRates[k]) * b.mean(kRates[k]);
    }
  }
  return judged;
}

Judged judge(const Scene& scene, const LangevinOptions& options, std::uint64_t seed,
             const Pilot& pilot) {
  const auto pairs = static_cast<std::uint64_t>(options.redistribution.pilot) / kFewer;
  std::vector<Judged> parts(std::max<std::uint64_t>(1, pairs / kTask));
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
    parts[i] = run_task(scene, pilot, options.max_depth, seed, i * kTask);
  });
  Judged sum;
  for (const Judged& part : parts) sum += part;
  return sum;
}

}  // namespace

void choose_light_rate(const Scene& scene, const LangevinOptions& options, std::uint64_t seed,
                       Pilot& pilot) {
  if (options.redistribution.light_subpaths == 1.0) return;
  const Judged judged = judge(scene, options, seed, pilot);
  double rate = 1.0;
  double least = judged.inefficiency(0) / kWorth;
  for (std::size_t k = 1; k < kRates.size(); ++k)
    if (judged.inefficiency(k) < least) {
      least = judged.inefficiency(k);
      rate = kRates[k];
    }
  rate = options.redistribution.light_subpaths.value_or(rate);
  pilot.guide = pilot.guide.at_rate(rate);
  pilot.sample_cost = judged.work.at(rate) / judged.work.at(1.0);
}

}  // namespace driftlight
