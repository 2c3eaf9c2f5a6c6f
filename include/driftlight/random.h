// SPDX-License-Identifier: Apache-2.0
/// Random numbers. Streams belong to chains and samples, never to threads.
#pragma once

#include <boost/random/normal_distribution.hpp>
#include <cstdint>
#include <pcg_random.hpp>

#include "driftlight/scalar.h"

namespace driftlight {

/// What a stream of numbers is for; streams of different purpose or index are independent.
enum class Stream : std::uint64_t {
  Pilot,
  Bootstrap,
  Resampling,
  Chain,
  Pixel,
  Test,
  GradientCheck,
  SplittingPilot
};

class Rng {
 public:
  using result_type = pcg32::result_type;

  Rng(std::uint64_t seed, Stream purpose, std::uint64_t index)
      : engine_(seed, (static_cast<std::uint64_t>(purpose) << 48U) + index) {}

  /// Uniform in (0, 1): never 0, never 1.
  double uniform() { return (static_cast<double>(engine_()) + 0.5) * 0x1p-32; }
  Vec2d uniform2() {
    const double x = uniform();
    return {x, uniform()};
  }
  Vec3d uniform3() {
    const Vec2d xy = uniform2();
    return {xy.x(), xy.y(), uniform()};
  }
  /// N(0, 1)
  double normal() { return normal_(engine_); }

 private:
  pcg32 engine_;
  boost::random::normal_distribution<double> normal_;
};

}  // namespace driftlight
