// SPDX-License-Identifier: Apache-2.0
#include "driftlight/random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>

namespace driftlight {
namespace {

constexpr int kSide = 16;
constexpr int kCells = kSide * kSide;
constexpr int kStreams = 4096;
constexpr double kExpected = static_cast<double>(kStreams) / kCells;
constexpr int kRuns = 300;
/// What is drawn before the numbers looked at.
constexpr std::array kSkipped{0, 1, 5, 20};

/// Cells of (x, y), numbers `skipped` and the next of each of a run's streams: deviations of their
/// counts from what is expected, in units of its square root.
using Deviations = std::array<double, kCells>;

Deviations to_deviations(const std::array<int, kCells>& counts) {
  Deviations result{};
  for (std::size_t i = 0; i < kCells; ++i)
    result[i] = (counts[i] - kExpected) / std::sqrt(kExpected);
  return result;
}

Deviations deviations(std::uint64_t seed, Stream purpose, int skipped) {
  std::array<int, kCells> counts{};
  for (std::uint64_t i = 0; i < kStreams; ++i) {
    Rng rng(seed, purpose, i);
    for (int k = 0; k < skipped; ++k) rng.uniform();
    const Vec2d xy = kSide * rng.uniform2();
    ++counts[kSide * static_cast<std::size_t>(xy.x()) + static_cast<std::size_t>(xy.y())];
  }
  return to_deviations(counts);
}

double mean_product(const Deviations& a, const Deviations& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0) / kCells;
}

/// Of a mean of n squares of N(0, 1), or of their products (half of it).
double squares_error(int n) { return std::sqrt(2.0 / n); }
double products_error(int n) { return 1 / std::sqrt(n); }

constexpr double kSigmas = 4.5;

// Less than for independent numbers would be a lattice that is too even, more one that is uneven.
TEST(Rng, StreamsOfARunAreIndependent) {
  for (const int skipped : kSkipped) {
    double sum = 0;
    for (int run = 0; run < kRuns; ++run) {
      const Deviations d = deviations(run, Stream::Test, skipped);
      sum += mean_product(d, d);
    }
    EXPECT_NEAR(sum / kRuns, 1, kSigmas * squares_error(kRuns * kCells)) << skipped;
  }
}

TEST(Rng, NeighbouringSeedsErrIndependently) {
  for (const int skipped : kSkipped) {
    double sum = 0;
    Deviations last = deviations(0, Stream::Test, skipped);
    for (int run = 1; run <= kRuns; ++run) {
      const Deviations next = deviations(run, Stream::Test, skipped);
      sum += mean_product(last, next);
      last = next;
    }
    EXPECT_NEAR(sum / kRuns, 0, kSigmas * products_error(kRuns * kCells)) << skipped;
  }
}

// An error common to all seeds does not shrink in their mean.
TEST(Rng, RunsHaveNoErrorInCommon) {
  for (const int skipped : kSkipped) {
    Deviations sum{};
    for (int run = 0; run < kRuns; ++run) {
      const Deviations d = deviations(run, Stream::Test, skipped);
      std::transform(sum.begin(), sum.end(), d.begin(), sum.begin(), std::plus<>());
    }
    EXPECT_NEAR(mean_product(sum, sum) / kRuns, 1, kSigmas * squares_error(kCells)) << skipped;
  }
}

TEST(Rng, PurposesAreIndependent) {
  for (const int skipped : kSkipped) {
    double sum = 0;
    for (int run = 0; run < kRuns; ++run)
      sum += mean_product(deviations(run, Stream::Pixel, skipped),
                          deviations(run, Stream::Chain, skipped));
    EXPECT_NEAR(sum / kRuns, 0, kSigmas * products_error(kRuns * kCells)) << skipped;
  }
}

/// Of x, the number that follows a fork, and y, its own first one.
Deviations deviations_of_forks(std::uint64_t seed) {
  Rng rng(seed, Stream::Test, 0);
  std::array<int, kCells> counts{};
  for (int i = 0; i < kStreams; ++i) {
    Rng fork = rng.fork();
    const auto x = static_cast<std::size_t>(kSide * rng.uniform());
    ++counts[kSide * x + static_cast<std::size_t>(kSide * fork.uniform())];
  }
  return to_deviations(counts);
}

TEST(Rng, ForksAreIndependent) {
  double sum = 0;
  double product = 0;
  Deviations last = deviations_of_forks(0);
  for (int run = 1; run <= kRuns; ++run) {
    const Deviations next = deviations_of_forks(run);
    sum += mean_product(next, next);
    product += mean_product(last, next);
    last = next;
  }
  EXPECT_NEAR(sum / kRuns, 1, kSigmas * squares_error(kRuns * kCells));
  EXPECT_NEAR(product / kRuns, 0, kSigmas * products_error(kRuns * kCells));
}

TEST(Rng, SameStreamSameNumbers) {
  Rng a(7, Stream::Pixel, 3);
  Rng b(7, Stream::Pixel, 3);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.uniform(), b.uniform());
}

}  // namespace
}  // namespace driftlight
