// SPDX-License-Identifier: Apache-2.0
#include "light_rate.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
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

/// w, or what has the square of its cut noise.
double cut(double w) { return std::sqrt(w < kBright ? w * w : kBright * (2.0 * w - kBright)); }

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

/// Of two samples at one film point.
double noise_of(const Sums& a, const Sums& b, double rate) {
  return 0.5 * (a.square(rate) + b.square(rate)) - a.mean(rate) * b.mean(rate);
}

/// Of samples with a light subpath each.
struct Work {
  double sensor = 0;
  double light = 0;

  double at(double rate) const { return sensor + rate * light; }
};

/// What pairs of samples tell of all rates.
struct Judged {
  std::array<double, kRates.size()> noise{};
  std::array<double, kRates.size()> cut{};
  Work work;

  Judged& operator+=(const Judged& other) {
    for (std::size_t k = 0; k < kRates.size(); ++k) {
      noise[k] += other.noise[k];
      cut[k] += other.cut[k];
    }
    work.sensor += other.work.sensor;
    work.light += other.work.light;
    return *this;
  }
};

/// Adds up what a sample finds.
class Sink {
 public:
  Sink(const Vec2d& film, const BrightnessMap& brightness) : film_(film), brightness_(brightness) {}

  void add(const Rgbd& value, const FoundPath& path) {
    const double w = weight(film_, value);
    if (path.s > 1) {
      whole.light += w;
      bounded.light += cut(w);
    } else {
      whole.sensor += w;
      bounded.sensor += cut(w);
    }
  }
  void splat(const Vec2d& film, const Rgbd& value, const FoundPath&) {
    const double w = weight(film, value);
    whole.splats2 += sqr(w);
    bounded.splats2 += sqr(cut(w));
  }

  Sums whole;
  Sums bounded;  ///< with bright paths cut

 private:
  double weight(const Vec2d& film, const Rgbd& value) const {
    const double y = luminance(value);
    return std::isfinite(y) ? y / brightness_(film) : 0.0;
  }

  Vec2d film_;
  const BrightnessMap& brightness_;
};

/// Adds the tracer's last sample.
void add_work(const BidirectionalTracer& tracer, int max_depth, Work& work) {
  const int z = tracer.from_sensor().size();
  const int y = tracer.from_light().size();
  int connections = y;  // to the sensor
  for (int j = 0; j < y; ++j)
    for (int i = 0; i < z && i + j + 3 <= max_depth; ++i)
      if (tracer.from_sensor()[i].connects && tracer.from_light()[j].connects) ++connections;
  work.sensor += 1.0 + (1.0 + kConnectionCost) * z;
  work.light += 1.0 + y + kConnectionCost * connections;
}

/// Pairs first .. first + kTask - 1.
Judged run_task(const Scene& scene, const Pilot& pilot, int max_depth, std::uint64_t seed,
                std::uint64_t first) {
  Judged judged;
  for (std::size_t k = 0; k < kRates.size(); ++k) {
    const EmissionGuide guide = pilot.guide.at_rate(kRates[k]);
    BidirectionalTracer tracer(scene, guide, MisHeuristic::Power, max_depth);
    for (std::uint64_t i = first; i < first + kTask; ++i) {
      Rng rng(seed, Stream::LightRate, i);
      const Vec2d film = rng.uniform2();
      std::array<Sink, 2> pair{Sink(film, pilot.brightness), Sink(film, pilot.brightness)};
      for (Sink& sink : pair) {
        tracer.sample(film, SampleNumbers{rng, rng, rng}, true, sink);
        if (k == 0) add_work(tracer, max_depth, judged.work);
      }
      judged.noise[k] += noise_of(pair[0].whole, pair[1].whole, kRates[k]);
      judged.cut[k] += noise_of(pair[0].bounded, pair[1].bounded, kRates[k]);
    }
  }
  return judged;
}

}  // namespace

std::vector<LightRate> judge_light_rates(const Scene& scene, const LangevinOptions& options,
                                         std::uint64_t seed, const Pilot& pilot) {
  const auto pairs = static_cast<std::uint64_t>(options.redistribution.pilot) / kFewer;
  std::vector<Judged> parts(std::max<std::uint64_t>(1, pairs / kTask));
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
    parts[i] = run_task(scene, pilot, options.max_depth, seed, i * kTask);
  });
  Judged sum;
  for (const Judged& part : parts) sum += part;
  const auto count = static_cast<double>(parts.size() * kTask);
  std::vector<LightRate> rates;
  for (std::size_t k = 0; k < kRates.size(); ++k)
    rates.push_back({kRates[k], sum.noise[k] / count, sum.cut[k] / count,
                     sum.work.at(kRates[k]) / sum.work.at(1.0)});
  return rates;
}

void choose_light_rate(const Scene& scene, const LangevinOptions& options, std::uint64_t seed,
                       Pilot& pilot) {
  const std::optional<double> wanted = options.redistribution.light_subpaths;
  if (wanted == 1.0) return;
  const std::vector<LightRate> rates = judge_light_rates(scene, options, seed, pilot);
  const LightRate& all = rates.front();
  LightRate best = all;
  double least = 1.0 / kWorth;
  for (const LightRate& at : rates) {
    const double inefficiency = at.cost * std::max(at.noise / all.noise, at.cut / all.cut);
    if (inefficiency < least) {
      best = at;
      least = inefficiency;
    }
  }
  if (wanted) {
    // Costs are linear in the rate.
    const LightRate& low = rates.back();
    const double of_light = (1.0 - low.cost) / (1.0 - low.rate);
    best.rate = *wanted;
    best.cost = 1.0 - (1.0 - *wanted) * of_light;
  }
  pilot.guide = pilot.guide.at_rate(best.rate);
  pilot.sample_cost = best.cost;
}

}  // namespace driftlight
