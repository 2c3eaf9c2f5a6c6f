// SPDX-License-Identifier: Apache-2.0
/// Laws of primary sample space. That its images are right is for the slow tests.
#include "primary_sample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "driftlight/error.h"
#include "driftlight/render.h"
#include "primary_target.h"
#include "strategy_chain.h"
#include "strategy_target.h"
#include "support/chi_square.h"
#include "support/t_test.h"
#include "support/test_scenes.h"
#include "systematic_resampling.h"

namespace driftlight::test {
namespace {

/// The first coordinates.
std::vector<double> read(PrimarySample& sample, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(sample.next());
  return values;
}

double distance(double a, double b) {
  const double d = std::abs(a - b);
  return std::min(d, 1.0 - d);
}

/// From the point of a second step the first one leads to the ghost, and the second one back.
TEST(PrimarySample, GhostIsMovedByBothSteps) {
  const PrimaryOptions options;
  PrimarySample sample(options, Rng(6, Stream::Test, 0));
  const std::vector<double> start = read(sample, 2);
  sample.propose_small();
  const std::vector<double> first = read(sample, 2);
  sample.propose_second();
  const std::vector<double> second = read(sample, 3);
  sample.show_ghost();
  const std::vector<double> ghost = read(sample, 4);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(distance(ghost[i], second[i]), distance(first[i], start[i]), 1e-12);
    EXPECT_NEAR(distance(ghost[i], first[i]), distance(second[i], start[i]), 1e-12);
    EXPECT_LE(distance(second[i], start[i]),
              options.delayed_rejection.second_scale * options.step_max + 1e-12);
  }
  sample.accept_second();
  sample.propose_small();
  const std::vector<double> next = read(sample, 3);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LE(distance(next[i], second[i]), options.step_max + 1e-12);
}

TEST(PrimarySample, RejectionBringsTheOldPointBack) {
  const PrimaryOptions options;
  PrimarySample sample(options, Rng(1, Stream::Test, 0));
  const std::vector<double> start = read(sample, 4);
  sample.propose_small();
  EXPECT_NE(read(sample, 4), start);
  sample.propose_large();
  EXPECT_NE(read(sample, 6), start);
  // A step that asks for fewer leaves the others where they were, and asks them to follow later.
  sample.propose_small();
  EXPECT_NE(read(sample, 1).front(), start.front());
  PrimarySample copy = sample;
  copy.propose_small();
  const std::vector<double> moved = read(copy, 4);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NE(moved[i], start[i]);
    EXPECT_LE(distance(moved[i], start[i]), options.step_max + 1e-12);
  }
}

/// log(step) is uniform between the sizes, the sign is even, and the ends of the interval meet.
TEST(PrimarySample, SmallStepsHaveTheirDensity) {
  PrimaryOptions options;
  options.step_min = 0.001;
  options.step_max = 0.1;
  std::vector<double> logarithms;
  std::vector<double> signs;
  PrimarySample sample(options, Rng(2, Stream::Test, 0));
  double from = sample.next();
  for (int i = 0; i < 20000; ++i) {
    sample.propose_small();
    const double to = sample.next();
    sample.accept();
    ASSERT_GT(to, 0.0);
    ASSERT_LT(to, 1.0);
    logarithms.push_back(std::log(distance(from, to) / options.step_min) / std::log(100.0));
    signs.push_back(std::fmod(to - from + 1.0, 1.0) < 0.5 ? 0.25 : 0.75);
    from = to;
  }
  EXPECT_GT(chi_square_uniform(logarithms).p_value, 1e-3);
  EXPECT_GT(chi_square_uniform(signs, 2).p_value, 1e-3);
}

/// Whatever is accepted, every coordinate stays uniform, those too that are seldom asked for.
TEST(PrimarySample, StaysUniform) {
  PrimaryOptions options;
  options.step_max = 0.4;
  std::vector<double> first;
  std::vector<double> last;
  for (std::uint64_t i = 0; i < 5000; ++i) {
    PrimarySample sample(options, Rng(3, Stream::Test, 2 * i));
    Rng rng(3, Stream::Test, 2 * i + 1);
    sample.next();
    for (int step = 0; step < 20; ++step) {
      const bool large = rng.uniform() < 0.2;
      large ? sample.propose_large() : sample.propose_small();
      read(sample, rng.uniform() < 0.3 ? 3 : 1);
      if (rng.uniform() < 0.5) {
        sample.accept();
      } else if (!large) {
        sample.propose_second();
        read(sample, rng.uniform() < 0.3 ? 3 : 1);
        sample.show_ghost();
        read(sample, rng.uniform() < 0.3 ? 3 : 1);
        if (rng.uniform() < 0.5) sample.accept_second();
      }
    }
    sample.propose_small();
    const std::vector<double> values = read(sample, 3);
    first.push_back(values.front());
    last.push_back(values.back());
  }
  EXPECT_GT(chi_square_uniform(first).p_value, 1e-3);
  EXPECT_GT(chi_square_uniform(last).p_value, 1e-3);
}

TEST(SystematicResampling, TakesEachAsOftenAsItWeighs) {
  const std::vector<double> weights{0.0, 1.0, 0.0, 2.5, 0.5, 0.0};
  for (const double offset : {1e-9, 0.3, 0.7, 1.0 - 1e-9}) {
    std::vector<int> count(weights.size(), 0);
    for (const std::size_t i : systematic_resampling(weights, 80, offset)) ++count[i];
    EXPECT_EQ(std::accumulate(count.begin(), count.end(), 0), 80);
    for (std::size_t i = 0; i < weights.size(); ++i)
      EXPECT_LE(std::abs(count[i] - 20.0 * weights[i]), 1.0) << i;
  }
}

/// Law: inside a closed diffuse sphere of albedo rho that emits L = 1, paths of n edges bring
/// rho^(n - 1).
TEST(PrimaryTarget, HasTheIntegralOfAClosedFurnace) {
  const double albedo = 0.6;
  const Scene scene = furnace(albedo);
  const EmissionGuide unguided(scene);
  const PrimaryOptions options;
  std::vector<PrimarySplat> splats;
  PrimaryTarget target(scene, unguided, 3, 5);
  Moments all;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    PrimaryPoint point(options, 4, Stream::Test, i);
    all.add(target(point, splats));
  }
  const double expected = std::pow(albedo, 2) + std::pow(albedo, 3) + std::pow(albedo, 4);
  EXPECT_GT(student_p_value(all, expected), 0.01) << all.mean();
  EXPECT_LT(all.error(), 0.02 * expected);
}

/// The same by one strategy at a time, and by all with the numbers of one point.
TEST(StrategyTarget, HasTheIntegralOfAClosedFurnace) {
  const double albedo = 0.6;
  const Scene scene = furnace(albedo);
  const EmissionGuide unguided(scene);
  PrimaryPlace place;
  const double level = sidak(0.01, 6);
  for (int n = 1; n <= 5; ++n) {
    StrategyTarget target(scene, unguided, 1, n);
    Moments one;
    for (std::uint64_t i = 0; i < 20000; ++i) {
      Rng rng(4, Stream::Test, i);
      const StrategyNumbers numbers(n, target.has_lens(), rng);
      target(numbers, numbers.strategy(), place);
      one.add((n + 1) * place.target);
    }
    const double expected = std::pow(albedo, n - 1);
    EXPECT_GT(student_p_value(one, expected), level) << n << ": " << one.mean();
    EXPECT_LT(one.error(), 0.03 * expected);
  }
  StrategyTarget target(scene, unguided, 3, 5);
  Moments all;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    Rng rng(4, Stream::Test, i);
    target.sample(StrategyNumbers(5, target.has_lens(), rng), rng, place);
    all.add(place.target);
  }
  const double expected = std::pow(albedo, 2) + std::pow(albedo, 3) + std::pow(albedo, 4);
  EXPECT_GT(student_p_value(all, expected), level) << all.mean();
  EXPECT_LT(all.error(), 0.02 * expected);
}

/// However dim a path is, its colour is one of luminance 1: the film cannot overflow.
TEST(PrimaryTarget, ColoursAreBoundedWhereLightHardlyIs) {
  const Scene bright = furnace(0.6);
  auto emitter = std::get<AreaEmitter>(bright.emitters()[0]);
  emitter.radiance = {3e-312, 1e-310, 2e-311};
  const Scene scene = bright.with_emitters({emitter});
  const EmissionGuide unguided(scene);
  const PrimaryOptions options;
  PrimaryTarget target(scene, unguided, 1, 5);
  std::vector<PrimarySplat> splats;
  int seen = 0;
  for (std::uint64_t i = 0; i < 100; ++i) {
    PrimaryPoint point(options, 5, Stream::Test, i);
    target(point, splats);
    for (const PrimarySplat& splat : splats) {
      ++seen;
      ASSERT_NEAR(luminance(splat.color), 1.0, 0.01);
    }
  }
  EXPECT_GT(seen, 100);
  EXPECT_EQ(target.take_non_finite(), 0U);
}

TEST(Primary, DoesNotDependOnThreads) {
  const Scene scene = furnace(0.6);
  PssmltOptions pssmlt;
  pssmlt.bootstrap = 1000;
  MmltOptions mmlt;
  mmlt.bootstrap = 1000;
  H2mcOptions h2mc;
  h2mc.bootstrap = 1000;
  LmcOptions lmc;
  lmc.bootstrap = 1000;
  LmcOptions cached = lmc;
  cached.cache = 100;
  MalaOptions mala;
  mala.bootstrap = 1000;
  std::vector<std::vector<float>> images;
  for (const int threads : {1, 2, 4}) {
    RenderOptions render;
    render.threads = threads;
    render.seed = 3;
    images.push_back(render_pssmlt(scene, pssmlt, render, 4).image.rgb);
    images.push_back(render_mmlt(scene, mmlt, render, 4).image.rgb);
    images.push_back(render_h2mc(scene, h2mc, render, 1).image.rgb);
    images.push_back(render_lmc(scene, lmc, render, 1).image.rgb);
    images.push_back(render_lmc(scene, cached, render, 1).image.rgb);
    images.push_back(render_mala(scene, mala, render, 1).image.rgb);
  }
  EXPECT_NE(images[3], images[4]);
  for (std::size_t i = 6; i < images.size(); ++i) EXPECT_EQ(images[i], images[i % 6]);
}

TEST(StrategyChain, RefusesWhatIsNotANumber) {
  Rejections rejections;
  EXPECT_EQ(acceptance_of(0.3, rejections), 0.3);
  EXPECT_EQ(acceptance_of(kInfinity, rejections), 1.0);
  EXPECT_EQ(rejections.non_finite, 0U);
  EXPECT_EQ(acceptance_of(std::numeric_limits<double>::quiet_NaN(), rejections), 0.0);
  EXPECT_EQ(rejections.non_finite, 1U);
}

TEST(Primary, OptionsAreChecked) {
  PrimaryOptions options;
  options.step_min = 0.5;
  EXPECT_THROW(options.validate(), OptionError);
  options.step_max = 0.5;
  EXPECT_NO_THROW(options.validate());
  options.step_max = 1.5;
  EXPECT_THROW(options.validate(), OptionError);
  H2mcOptions h2mc;
  h2mc.sigma = 0;
  EXPECT_THROW(h2mc.validate(), OptionError);
  LmcOptions lmc;
  lmc.adaptation_decay = 1.5;
  EXPECT_THROW(lmc.validate(), OptionError);
  MalaOptions mala;
  EXPECT_NO_THROW(mala.validate());
  mala.kernel.drift = Drift::Full;
  EXPECT_THROW(mala.validate(), OptionError);
  mala.kernel = {};
  mala.kernel.preconditioner = PreconditionerKind::Hessian;
  EXPECT_THROW(mala.validate(), OptionError);
}

}  // namespace
}  // namespace driftlight::test
