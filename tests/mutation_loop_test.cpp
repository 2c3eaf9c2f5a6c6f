// SPDX-License-Identifier: Apache-2.0
/// Law: chains of mutations leave their target invariant, with delayed rejection and without.
#include "mutation_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "support/t_test.h"

namespace driftlight {
namespace {

using test::Moments;

/// pi = exp(-x^4 / 4 + x / 2) where x < 1.2, else 0: not normalised.
double target(double x) { return x < 1.2 ? std::exp(-0.25 * x * x * x * x + 0.5 * x) : 0.0; }

/// Steps are longer where x is large, so that they are not symmetric.
double step_size(double x) { return 1.0 + 0.8 * std::tanh(x); }

constexpr int kObservables = 3;
std::array<double, kObservables> observables(double x) { return {x, x * x, x > 0.9 ? 1.0 : 0.0}; }

/// By a grid over all that has a weight.
constexpr int kCells = 200000;
double at_cell(double i) { return -4.0 + 5.2 * i / kCells; }

std::array<double, kObservables> expected() {
  std::array<double, kObservables> sums{};
  double total = 0;
  for (int i = 0; i < kCells; ++i) {
    const double x = at_cell(i + 0.5);
    total += target(x);
    for (int k = 0; k < kObservables; ++k) sums[k] += target(x) * observables(x)[k];
  }
  for (double& sum : sums) sum /= total;
  return sums;
}

/// A sample of pi.
double draw(Rng& rng) {
  while (true) {
    const double x = at_cell(kCells * rng.uniform());
    if (rng.uniform() * 1.5 < target(x)) return x;
  }
}

/// Whether second steps know of the ghost.
enum class Ghost { Counted, Forgotten };

/// The smallest p-value of the observables over independent chains.
double smallest_p_value(bool delayed_rejection, Ghost ghost) {
  const auto propose = [&](double& x, double& y, MutationStage stage, Rng& rng, Rejections&) {
    if (stage == MutationStage::Ghost && ghost == Ghost::Forgotten) return 0.0;
    const double scale = stage == MutationStage::Second ? 0.3 : 1.0;
    const auto density = [scale](double from, double to) {
      const double s = scale * step_size(from);
      return std::exp(-0.5 * (to - from) * (to - from) / (s * s)) / s;
    };
    y = x + scale * step_size(x) * rng.normal();
    return target(y) * density(y, x) / (target(x) * density(x, y));
  };
  constexpr std::uint64_t kMutations = 40;
  const auto mean = expected();
  std::array<Moments, kObservables> moments;
  for (std::uint64_t chain = 0; chain < 20000; ++chain) {
    Rng rng(77, Stream::Test, chain);
    double start = draw(rng);
    std::array<double, 3> memory{};
    ChainFigures figures;
    std::array<double, kObservables> sums{};
    double weights = 0;
    run_mutations(start, memory, {kMutations, delayed_rejection}, rng, figures, propose,
                  [&](double x, double weight) {
                    weights += weight;
                    for (int k = 0; k < kObservables; ++k) sums[k] += weight * observables(x)[k];
                  });
    EXPECT_NEAR(weights, kMutations, 1e-9);
    for (int k = 0; k < kObservables; ++k) moments[k].add(sums[k] / kMutations);
  }
  double smallest = 1;
  for (int k = 0; k < kObservables; ++k)
    smallest = std::min(smallest, student_p_value(moments[k], mean[k]));
  return smallest;
}

TEST(MutationLoop, LeavesTheTargetInvariant) {
  EXPECT_GT(smallest_p_value(false, Ghost::Counted), 1e-3);
}

TEST(MutationLoop, DelayedRejectionLeavesTheTargetInvariant) {
  EXPECT_GT(smallest_p_value(true, Ghost::Counted), 1e-3);
  EXPECT_LT(smallest_p_value(true, Ghost::Forgotten), 1e-6);
}

/// The states that it returns are of the target too, and second steps are counted.
TEST(MutationLoop, ReturnsTheLastState) {
  const auto walk = [](const int& from, int& to, MutationStage stage, Rng&, Rejections&) {
    to = stage == MutationStage::Second ? from + 10 : from + 1;
    return stage == MutationStage::Second ? 1.0 : 0.0;
  };
  const auto ignore = [](int, double) {};
  int start = 5;
  std::array<int, 3> memory{};
  Rng rng(1, Stream::Test, 0);
  ChainFigures figures;
  EXPECT_EQ(run_mutations(start, memory, {4, false}, rng, figures, walk, ignore), 5);
  EXPECT_EQ(figures.second_step.proposed, 0U);
  EXPECT_EQ(run_mutations(start, memory, {4, true}, rng, figures, walk, ignore), 45);
  EXPECT_EQ(start, 5);
  EXPECT_EQ(figures.small_step.proposed, 8U);
  EXPECT_EQ(figures.second_step.proposed, 4U);
  EXPECT_EQ(figures.second_step.accepted, 4.0);
}

}  // namespace
}  // namespace driftlight
