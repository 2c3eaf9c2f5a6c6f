// SPDX-License-Identifier: Apache-2.0
/// Random numbers. Streams belong to chains and samples, never to threads.
#pragma once

#include <boost/random/normal_distribution.hpp>
#include <cassert>
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
  SplittingPilot,
  ChainPilot,
  LightRate
};

/// Uniform numbers in (0, 1) from elsewhere than a generator.
class UniformSource {
 public:
  virtual double next() = 0;

 protected:
  ~UniformSource() = default;
};

class Rng {
 public:
  using result_type = pcg32::result_type;

  Rng(std::uint64_t seed, Stream purpose, std::uint64_t index)
      : Rng(mixed(mixed(seed) + static_cast<std::uint64_t>(purpose)), index) {}

  /// Hands on the numbers of a source, which must outlive it. It has uniform numbers only.
  explicit Rng(UniformSource& source) : source_(&source) {}

  /// Uniform in (0, 1): never 0, never 1.
  double uniform() {
    if (source_ != nullptr) return source_->next();
    return (static_cast<double>(engine_()) + 0.5) * 0x1p-32;
  }
  Vec2d uniform2() {
    const double x = uniform();
    return {x, uniform()};
  }
  Vec3d uniform3() {
    const Vec2d xy = uniform2();
    return {xy.x(), xy.y(), uniform()};
  }
  /// N(0, 1)
  double normal() {
    assert(source_ == nullptr);
    return normal_(engine_);
  }

  /// A generator of its own, by two numbers of this one.
  Rng fork() {
    assert(source_ == nullptr);
    const std::uint64_t key = engine_();
    return Rng(mixed(key), engine_());
  }

 private:
  /// PCG's own streams differ in the increment of one linear generator, so the n-th states of
  /// consecutive streams are an arithmetic progression, and so are those of consecutive seeds:
  /// means over many short streams err alike in every run, and runs agree better than they are
  /// right. State and increment are hashes instead. Indices of one key never share a state.
  Rng(std::uint64_t key, std::uint64_t index)
      : engine_(mixed(key + index), mixed(mixed(key + index) + key)) {}

  /// A bijection whose every output bit depends on every input bit: a step of SplitMix64 (Steele,
  /// Lea and Flood, Fast splittable pseudorandom number generators, 2014).
  static constexpr std::uint64_t mixed(std::uint64_t bits) {
    bits += 0x9e3779b97f4a7c15U;
    bits = (bits ^ (bits >> 30U)) * 0xbf58476d1ce4e5b9U;
    bits = (bits ^ (bits >> 27U)) * 0x94d049bb133111ebU;
    return bits ^ (bits >> 31U);
  }

  UniformSource* source_ = nullptr;
  pcg32 engine_;
  boost::random::normal_distribution<double> normal_;
};

}  // namespace driftlight
