// SPDX-License-Identifier: Apache-2.0
/// Laws of emitted rays and of their guide.
#include "emission_guide.h"

#include <gtest/gtest.h>

#include <cmath>

#include "driftlight/running_mean.h"
#include "support/chi_square.h"
#include "support/learned_guide.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

EmissionSample draw(Rng& rng) {
  return {rng.uniform(), rng.uniform(), rng.uniform(), rng.uniform()};
}

/// A point of the ray of an emission beyond its origin; the origin itself of a finite emitter.
Vec3d point_on(const Emission& ray, double t) {
  return ray.end.at_infinity() ? Vec3d(ray.origin + t * ray.direction) : ray.origin;
}

// Law: the sample of a ray is that which it was drawn from.
TEST(Emission, SampleIsTheInverseOfEmit) {
  int axes_seen = 0;
  for (const TestScene& test : test_scenes()) {
    SCOPED_TRACE(test.name);
    for (std::uint32_t e = 0; e < test.scene.emitters().size(); ++e) {
      const EmissionAxes axes = invertible_axes(test.scene, e);
      Rng rng(301, Stream::Test, e);
      for (int i = 0; i < 2000; ++i) {
        const EmissionSample u = draw(rng);
        const Emission ray = emit(test.scene, e, u);
        const EmissionSample found =
            emission_sample(test.scene, e, point_on(ray, rng.uniform()), ray.direction);
        for (std::size_t a = 0; a < axes.size(); ++a) {
          if (!axes[a]) continue;
          ++axes_seen;
          const double turn = std::abs(found[a] - u[a]);
          EXPECT_LT(std::min(turn, 1.0 - turn), 1e-6) << "emitter " << e << ", axis " << a;
        }
      }
    }
  }
  EXPECT_GT(axes_seen, 40000);
}

// Law: a ray drawn from a sphere is that of a uniform point with a direction by the cosine.
TEST(Emission, OfASphereIsEvenAndByTheCosine) {
  const double significance = sidak(0.01, 3);
  for (const TestScene& test : test_scenes()) {
    for (std::uint32_t e = 0; e < test.scene.emitters().size(); ++e) {
      const auto* area = std::get_if<AreaEmitter>(&test.scene.emitters()[e]);
      if (area == nullptr) continue;
      const auto* sphere = std::get_if<Sphere>(&test.scene.shapes()[area->shape].geometry);
      if (sphere == nullptr) continue;
      Rng rng(302, Stream::Test, 0);
      const SphereGrid grid(Vec3d(0.6, 0.0, 0.8), 16, 16, 1.0);
      const auto even = [](const Vec3d&) { return 0.25 * kInvPi; };
      const auto normal = [&] { return emit(test.scene, e, draw(rng)).end.n; };
      const auto direction = [&] { return emit(test.scene, e, draw(rng)).direction; };
      const auto local = [&] {
        const Emission ray = emit(test.scene, e, draw(rng));
        return to_local(ray.direction, ray.end.n);
      };
      const auto cosine = [](const Vec3d& d) { return std::max(0.0, d.z()) * kInvPi; };
      const SphereGrid about_z(Vec3d::UnitZ(), 16, 16, 1.0);
      EXPECT_GT(chi_square_directions(grid, 40000, normal, even).p_value, significance);
      EXPECT_GT(chi_square_directions(grid, 40000, direction, even).p_value, significance);
      EXPECT_GT(chi_square_directions(about_z, 40000, local, cosine).p_value, significance);
      return;
    }
  }
  FAIL() << "no scene has a spherical emitter";
}

/// Records of estimates that are large within a small box of the cube.
DensityTree tree_about(double center, double half) {
  Rng rng(303, Stream::Test, 0);
  std::vector<CubeRecord> records;
  for (int i = 0; i < 40000; ++i) {
    CubeRecord r{};
    bool inside = true;
    for (std::size_t a = 0; a < 4; ++a) {
      r.at[a] = static_cast<float>(rng.uniform());
      inside = inside && (a == 3 || std::abs(static_cast<double>(r.at[a]) - center) < half);
    }
    r.moment = inside ? 1.0F : 0.001F;
    records.push_back(r);
  }
  return DensityTree(records, {true, true, true, true}, 0.2);
}

// Law: the density is that of the samples: E[1 / density] over them is the volume, 1, over any box.
TEST(DensityTree, DensityIsThatOfItsSamples) {
  const DensityTree tree = tree_about(0.5, 0.1);
  RunningMean low;
  RunningMean high;
  Rng rng(304, Stream::Test, 0);
  for (int i = 0; i < 200000; ++i) {
    const auto x = tree.sample({rng.uniform(), rng.uniform(), rng.uniform(), rng.uniform()});
    const double volume = 1.0 / tree.density(x);
    (x[0] < 0.4 ? low : high).add(volume);
  }
  const double n = 200000;
  EXPECT_NEAR(low.sum / n, 0.4, 0.02);
  EXPECT_NEAR(high.sum / n, 0.6, 0.02);
}

/// Structure in the middle of the cube is found, and nothing becomes much rarer than it was.
TEST(DensityTree, FindsWhatIsThere) {
  const DensityTree tree = tree_about(0.5, 0.1);
  EXPECT_GT(tree.density({0.5, 0.5, 0.5, 0.3}), 5.0);
  Rng rng(305, Stream::Test, 0);
  for (int i = 0; i < 1000; ++i) EXPECT_GE(tree.density(draw(rng)), 0.2 - 1e-12);
}

TEST(DensityTree, IsUniformWithoutRecords) {
  std::vector<CubeRecord> none;
  const DensityTree tree(none, {true, true, true, true}, 0.2);
  EXPECT_TRUE(tree.is_uniform());
  EXPECT_EQ(tree.density({0.1, 0.2, 0.3, 0.4}), 1.0);
}

/// Integral of the guide's density over that of emission, and the least of it, by rays of emission.
TEST(EmissionGuide, FactorsAverageToOne) {
  for (const TestScene& test : test_scenes()) {
    SCOPED_TRACE(test.name);
    const EmissionGuide guide = learned_guide(test);
    const EmissionGuide unguided(test.scene);
    Rng rng(306, Stream::Test, 0);
    RunningMean mean;
    double largest = 0;
    for (int i = 0; i < 100000; ++i) {
      const Emission ray = unguided.sample(rng);
      const double factor = guide.factor(ray.end.emitter, ray.origin, ray.direction);
      EXPECT_GE(factor, 0.04 - 1e-12);
      largest = std::max(largest, factor);
      mean.add(factor);
    }
    EXPECT_NEAR(mean.mean(), 1.0, 0.05);
    EXPECT_GT(largest, 1.2);
  }
}

}  // namespace
}  // namespace driftlight::test
