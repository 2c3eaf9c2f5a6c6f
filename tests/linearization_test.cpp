// SPDX-License-Identifier: Apache-2.0
/// Laws of the stage-by-stage derivatives: by jets and by hand they equal those of wide Jets over
/// the whole path, and the Riccati factor is a root of their Q.
#include "driftlight/linearization.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "driftlight/bootstrap.h"
#include "driftlight/chain.h"
#include "driftlight/factor.h"
#include "driftlight/scene_file.h"
#include "support/dense.h"
#include "support/path_classes.h"
#include "support/places.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

struct Prepared {
  Chart chart;
  PathDerivatives wide;
  Linearization local;

  Prepared(const Scene& scene, const Path& path, DerivativeMethod method)
      : chart(scene, path.topology, path.coordinates) {
    differentiate(scene, path.topology, chart, {}, wide);
    linearize(scene, path.topology, chart, method, {}, local);
  }
  Matrix q() const { return wide.q.selfadjointView<Eigen::Lower>(); }
  void set_floor(double floor) {
    local.floor = floor;
    wide.q.diagonal().array() += floor - kConstraintFloor;
  }
};

class Linearize : public testing::TestWithParam<DerivativeMethod> {};

INSTANTIATE_TEST_SUITE_P(Methods, Linearize,
                         testing::Values(DerivativeMethod::Jet, DerivativeMethod::Hand),
                         [](const auto& test) {
                           return test.param == DerivativeMethod::Jet ? "Jet" : "Hand";
                         });

/// Differences in units of the widths: |D^-1/2 x|, D = diag Q.
double scaled_norm(const Vector& x, const Matrix& q) {
  return x.cwiseQuotient(q.diagonal().cwiseSqrt()).norm();
}

// Law: gradient and Q are those of wide Jets, in every class.
TEST_P(Linearize, EqualsWideJetsInEveryClass) {
  ClassCounter classes;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 1000, 21)) {
      const Prepared p(test.scene, path, GetParam());
      const Matrix q = p.q();
      const Vector difference = p.local.gradient - p.wide.gradient;
      EXPECT_LT(scaled_norm(difference, q), 1e-10 * (1.0 + scaled_norm(p.wide.gradient, q)))
          << test.name << " gradient " << p.local.gradient.transpose() << "\n instead of "
          << p.wide.gradient.transpose();
      const Vector scale = q.diagonal().cwiseSqrt().cwiseInverse();
      const Matrix error =
          scale.asDiagonal() * (constraint_matrix(p.local) - q) * scale.asDiagonal();
      EXPECT_LT(error.norm(), 1e-10) << test.name;
      classes.add(classes_of(test.scene, path));
    }
  }
  for (const std::string& missing : classes.missing(3)) ADD_FAILURE() << missing;
}

// Law: what is asked for does not change what comes out, and nothing else does come out.
TEST_P(Linearize, PartialRequestsAgreeWithTheFullOne) {
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 22)) {
      const Prepared p(test.scene, path, GetParam());
      Linearization gradient;
      linearize(test.scene, path.topology, p.chart, GetParam(), {true, false}, gradient);
      EXPECT_LT((gradient.gradient - p.local.gradient).norm(), 1e-12 * p.local.gradient.norm());
      EXPECT_EQ(gradient.row_count(), 0);
      Linearization constraints;
      linearize(test.scene, path.topology, p.chart, GetParam(), {false, true}, constraints);
      const Matrix q = constraint_matrix(p.local);
      EXPECT_LT((constraint_matrix(constraints) - q).norm(), 1e-12 * q.norm());
      EXPECT_EQ(constraints.gradient.size(), 0);
    }
  }
}

// Law: the stages apply Q to a vector as the dense matrix does.
TEST_P(Linearize, AppliesQ) {
  Rng rng(24, Stream::Test, 0);
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 24)) {
      Prepared p(test.scene, path, GetParam());
      if (rng.uniform() < 0.5) p.set_floor(30.0 * kConstraintFloor);
      Vector x(p.chart.dimension());
      for (double& component : x) component = rng.normal();
      const Vector expected = p.q() * x;
      EXPECT_LT((apply_constraints(p.local, x) - expected).norm(), 1e-11 * expected.norm());
    }
  }
}

// Law: derivatives at a displaced chart are those over the coordinates of the chart itself.
TEST_P(Linearize, AtADisplacedChart) {
  Rng rng(25, Stream::Test, 0);
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 25)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      Vector delta(chart.dimension());
      for (double& component : delta) component = 1e-4 * rng.normal();
      Matrix expected;
      constraint_matrix(test.scene, path.topology, chart, delta, expected);
      if (!expected.allFinite()) continue;
      Linearization local;
      linearize(test.scene, path.topology, chart.displaced(delta), GetParam(), {false, true},
                local);
      const Matrix difference =
          (constraint_matrix(local) - expected).triangularView<Eigen::Lower>();
      EXPECT_LT(difference.norm(), 1e-9 * expected.norm());
    }
  }
}

// Law: F^T F = Q, F^-1 and F^-T are its inverses, and log_det is half that of Q; whatever the
// floor.
TEST_P(Linearize, RiccatiFactorIsARootOfQ) {
  Rng rng(23, Stream::Test, 0);
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 500, 23)) {
      Prepared p(test.scene, path, GetParam());
      if (rng.uniform() < 0.5) p.set_floor(30.0 * kConstraintFloor);
      const RiccatiFactor factor(p.local);
      ASSERT_EQ(factor.status(), RiccatiFactor::Status::Ok);
      const Matrix q = p.q();
      const auto d = q.rows();
      Matrix f(d, d);
      Matrix inverse(d, d);
      Matrix transposed(d, d);
      for (Eigen::Index j = 0; j < d; ++j) {
        f.col(j) = factor.apply(Vector(Vector::Unit(d, j)));
        inverse.col(j) = factor.solve(Vector(f.col(j)));
        transposed.col(j) = factor.solve_transposed(Vector(Vector::Unit(d, j)));
      }
      const Vector scale = q.diagonal().cwiseSqrt().cwiseInverse();
      const Matrix error = scale.asDiagonal() * (f.transpose() * f - q) * scale.asDiagonal();
      EXPECT_LT(error.norm(), 1e-10);
      const Matrix unit = Matrix::Identity(d, d);
      // Rounding of a triangular solve grows with the condition of F in units of the widths.
      EXPECT_LT((inverse - unit).norm(), 1e-6) << test.name;
      EXPECT_LT((transposed * f.transpose() - unit).norm(), 1e-6) << test.name;
      // In units of the widths, as the condition of Q itself can take half of the digits.
      const Matrix in_widths = scale.asDiagonal() * q * scale.asDiagonal();
      const Matrix root = cholesky(in_widths);
      double log_det = 0.0;
      for (Eigen::Index j = 0; j < d; ++j) log_det += std::log(root(j, j) / scale[j]);
      // Where a tangent turns fast, as about the centre of a disk, Q is nearly singular in widths.
      const Vector values = eigenvalues(in_widths);
      const double condition = values[d - 1] / values[0];
      EXPECT_NEAR(factor.log_det(), log_det,
                  1e-8 + std::numeric_limits<double>::epsilon() * condition)
          << test.name;
    }
  }
}

/// One stage with two coordinates and these residual rows.
Linearization single_stage(const std::vector<Vec2d>& rows) {
  Linearization path;
  path.stage_count = 1;
  path.block_count = 1;
  path.stages[0].kind = Stage::Kind::Terminal;
  path.stages[0].has_block = true;
  path.stages[0].rows_end = static_cast<int>(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    path.rows.row(static_cast<Eigen::Index>(i)) << 0, 0, 0, 0, rows[i].x(), rows[i].y(), 0, 0;
  return path;
}

// Law: what cannot be factorised is told apart from what is not finite, and both from what can.
TEST(RiccatiFactor, StatusTellsWhatFailed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(RiccatiFactor(single_stage({{1, 2}})).status(), RiccatiFactor::Status::Ok);
  // The floor drowns in rounding.
  EXPECT_EQ(RiccatiFactor(single_stage({{1e10, 1e10}})).status(),
            RiccatiFactor::Status::Indefinite);
  EXPECT_EQ(RiccatiFactor(single_stage({{1, nan}})).status(), RiccatiFactor::Status::NonFinite);
  EXPECT_EQ(RiccatiFactor(single_stage({{1, 1e200}})).status(), RiccatiFactor::Status::NonFinite);
}

// Law: a matrix that is not positive definite has no Cholesky factor.
TEST(CholeskyFactor, NoneOfAnIndefiniteMatrix) {
  EXPECT_TRUE(CholeskyFactor::of(Matrix::Identity(3, 3)).has_value());
  Matrix q = Matrix::Identity(3, 3);
  for (const double bad : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    q(1, 1) = bad;
    EXPECT_FALSE(CholeskyFactor::of(q).has_value());
  }
}

// ---- Chains -----------------------------------------------------------------------------------

/// Two chains that differ in how derivatives are found, and in nothing else.
class TwinChains {
 public:
  TwinChains(const Scene& scene, int max_depth) : scene_(scene), sampler_(scene, max_depth) {
    jet_.kernel.derivatives = DerivativeMethod::Jet;
    hand_.kernel.derivatives = DerivativeMethod::Hand;
    start_ = Bootstrap(sampler_, scene, 20000, 5).resample(1).front();
  }

  /// Number of mutations before the first one that only one of the two accepts, each chain going
  /// its own way.
  int free_run(int mutations) {
    Chain jet = chain(jet_, start_, 0);
    Chain hand = chain(hand_, start_, 0);
    for (int i = 0; i < mutations; ++i)
      if (moves(jet) != moves(hand)) return i;
    return mutations;
  }

  struct Step {
    bool same = true;     ///< both accept, or neither
    double distance = 0;  ///< largest between their blocks afterwards
    bool moved = false;
  };
  /// Mutation `index` by both, from the state that the chain by jets has reached.
  Step step(int index) {
    Chain jet = chain(jet_, start_, index);
    Chain hand = chain(hand_, start_, index);
    Step result;
    result.moved = moves(jet);
    result.same = moves(hand) == result.moved;
    start_.topology = jet.state().topology;
    start_.coordinates = jet.state().coordinates;
    for (int k = 0; k < start_.topology.block_count; ++k)
      result.distance =
          std::max(result.distance, (start_.coordinates(k) - hand.state().coordinates(k)).norm());
    return result;
  }

 private:
  Chain chain(const LangevinOptions& options, const Path& start, int stream) {
    return {scene_, sampler_, options,
            film_,  start,    Rng(6, Stream::Chain, static_cast<std::uint64_t>(stream))};
  }
  static bool moves(Chain& chain) {
    const ChainState* before = &chain.state();
    chain.run(1);
    return &chain.state() != before;
  }

  const Scene& scene_;
  PathSampler sampler_;
  LangevinOptions jet_, hand_;
  Film film_{64, 64};
  Path start_;
};

constexpr int kMutations = 100000;

// Law: from one seed, a chain by jets and a chain by hand accept the same mutations.
TEST(DerivativeMethod, SameChainInTheFurnace) {
  const Scene scene = furnace(0.5);
  EXPECT_EQ(TwinChains(scene, 6).free_run(kMutations), kMutations);
}

/// Law: every mutation of a chain is the same by jets and by hand: decided alike, and into the same
/// state to rounding. (Left to themselves the two chains part at last: small steps amplify a
/// difference of rounding by a few per cent each, and only a large step makes them equal again.)
void expect_same_mutations(const Scene& scene, int max_depth) {
  TwinChains twins(scene, max_depth);
  int moved = 0;
  int decided_otherwise = 0;
  double distance = 0;
  for (int i = 0; i < kMutations; ++i) {
    const TwinChains::Step step = twins.step(i);
    moved += step.moved ? 1 : 0;
    decided_otherwise += step.same ? 0 : 1;
    if (step.same) distance = std::max(distance, step.distance);
  }
  EXPECT_EQ(decided_otherwise, 0);
  EXPECT_LT(distance, 1e-10);
  EXPECT_GT(moved, kMutations / 10);
}

TEST(DerivativeMethod, SameMutationsInTheRoom) {
  expect_same_mutations(test_scenes().front().scene, test_scenes().front().max_depth);
}

TEST(DerivativeMethod, SameMutationsInTheGlossyScene) {
  const auto file = test::own_scene("glossy_chain");
  const LoadedScene loaded = load_scene(file);
  EXPECT_GT(TwinChains(loaded.scene, 12).free_run(kMutations), 500);
  expect_same_mutations(loaded.scene, 12);
}

}  // namespace
}  // namespace driftlight::test
