// SPDX-License-Identifier: Apache-2.0
/// Laws of sampling maps: what comes out has the density that it should.
#include "driftlight/warp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "driftlight/frame.h"
#include "driftlight/random.h"
#include "support/chi_square.h"
#include "support/t_test.h"

namespace driftlight::test {
namespace {

constexpr int kCount = 40000;
const double kSignificance = sidak(0.01, 12);

// Law: uniform on the sphere, density 1 / (4 pi).
TEST(Warp, SphereIsUniform) {
  Rng rng(111, Stream::Test, 0);
  const SphereGrid grid(Vec3d(0.6, 0.0, 0.8), 16, 16, 1.0);
  const auto draw = [&] { return square_to_sphere(rng.uniform(), rng.uniform()); };
  const auto density = [](const Vec3d&) { return 0.25 * kInvPi; };
  EXPECT_GT(chi_square_directions(grid, kCount, draw, density).p_value, kSignificance);
}

// Law: about z with density cos / pi.
TEST(Warp, CosineHemisphere) {
  Rng rng(112, Stream::Test, 0);
  const SphereGrid grid(Vec3d::UnitZ(), 16, 16, 1.0);
  const auto draw = [&] { return square_to_cosine_hemisphere(rng.uniform(), rng.uniform()); };
  const auto density = [](const Vec3d& d) { return std::max(0.0, d.z()) * kInvPi; };
  EXPECT_GT(chi_square_directions(grid, kCount, draw, density).p_value, kSignificance);
}

// Law: about z with density (n + 1) / (2 pi) cos^n.
TEST(Warp, CosinePower) {
  Rng rng(113, Stream::Test, 0);
  for (const double n : {0.0, 1.0, 7.5, 300.0}) {
    const SphereGrid grid(Vec3d::UnitZ(), 24, 12, std::log(2.0) / std::log(24.0 / 17.0));
    const auto draw = [&] { return square_to_cosine_power(rng.uniform(), rng.uniform(), n); };
    const auto density = [&](const Vec3d& d) {
      return d.z() > 0.0 ? (n + 1.0) * 0.5 * kInvPi * std::pow(d.z(), n) : 0.0;
    };
    EXPECT_GT(chi_square_directions(grid, kCount, draw, density).p_value, kSignificance) << n;
  }
}

// Law: uniform on the disk: r^2 and the angle are uniform.
TEST(Warp, DiskIsUniform) {
  Rng rng(114, Stream::Test, 0);
  std::vector<double> squares;
  std::vector<double> turns;
  for (int i = 0; i < kCount; ++i) {
    const Vec2d p = square_to_disk(rng.uniform(), rng.uniform());
    ASSERT_LE(p.norm(), 1.0);
    squares.push_back(p.squaredNorm());
    turns.push_back(std::atan2(p.y(), p.x()) * 0.5 * kInvPi + 0.5);
  }
  EXPECT_GT(chi_square_uniform(squares).p_value, kSignificance);
  EXPECT_GT(chi_square_uniform(turns).p_value, kSignificance);
}

// Law: an index comes as often as its weight says, never where that is 0, and the number handed
// back is uniform and as good as new.
TEST(DiscreteDistribution, SamplesByWeight) {
  const std::vector<double> weights{0.0, 3.0, 0.0, 0.0, 1.0, 0.25, 4.0, 0.0};
  const DiscreteDistribution distribution(weights);
  EXPECT_EQ(distribution.size(), 8);
  EXPECT_DOUBLE_EQ(distribution.total(), 8.25);
  Rng rng(115, Stream::Test, 0);
  std::vector<double> counts(weights.size());
  std::vector<double> rest;
  for (int i = 0; i < kCount; ++i) {
    double u = rng.uniform();
    const int index = distribution.sample(u);
    counts[static_cast<std::size_t>(index)] += 1.0;
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    rest.push_back(u);
  }
  std::vector<double> expected;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double p = distribution.probability(static_cast<int>(i));
    EXPECT_NEAR(p, weights[i] / 8.25, 1e-15);
    expected.push_back(p * kCount);
    if (weights[i] == 0.0) {
      EXPECT_EQ(counts[i], 0.0);
    }
  }
  EXPECT_GT(chi_square(counts, expected).p_value, kSignificance);
  EXPECT_GT(chi_square_uniform(rest).p_value, kSignificance);
}

// Law: the ends of [0, 1) fall on indices of positive probability.
TEST(DiscreteDistribution, EdgesOfTheUnitInterval) {
  const DiscreteDistribution distribution(std::vector<double>{0.0, 1.0, 2.0, 0.0});
  for (const double start : {0.0, 1e-300, 1.0 / 3.0, 1.0 - 0x1p-53}) {
    double u = start;
    const int index = distribution.sample(u);
    EXPECT_GT(distribution.probability(index), 0.0) << start;
    EXPECT_GE(u, 0.0);
    EXPECT_LT(u, 1.0);
  }
}

// Law: tangent_basis completes n to a right-handed orthonormal basis, at the poles too, and
// to_local inverts to_world.
TEST(TangentBasis, OrthonormalAndRightHanded) {
  Rng rng(116, Stream::Test, 0);
  std::vector<Vec3d> normals{{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {1e-9, 0, -1}};
  for (int i = 0; i < 1000; ++i) normals.push_back(square_to_sphere(rng.uniform(), rng.uniform()));
  for (const Vec3d& n : normals) {
    const TangentBasis basis = tangent_basis(n);
    EXPECT_NEAR(basis.t.norm(), 1.0, 1e-12);
    EXPECT_NEAR(basis.t.dot(n), 0.0, 1e-12);
    EXPECT_LT((basis.t.cross(basis.b) - n).norm(), 1e-12);
    const Vec3d v = square_to_sphere(rng.uniform(), rng.uniform());
    EXPECT_LT((to_world(to_local(v, n), n) - v).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace driftlight::test
