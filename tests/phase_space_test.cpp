// SPDX-License-Identifier: Apache-2.0
/// Laws of the phase space of directions: charts are invertible with the right Jacobian, and
/// tracing gives back the paths that were sampled.
#include "driftlight/phase_space.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <string>

#include "driftlight/chart_rule.h"
#include "driftlight/contribution.h"
#include "driftlight/gradient.h"
#include "driftlight/kernel.h"
#include "driftlight/walk.h"
#include "support/path_classes.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

/// Equal in all that matters: the vertices in use, the blocks and the end.
bool same(const PathTopology& a, const PathTopology& b) {
  if (a.scatter_count != b.scatter_count || a.block_count != b.block_count || a.end != b.end ||
      a.emitter != b.emitter)
    return false;
  for (std::size_t k = 0; k < a.scatter_count; ++k) {
    const PathVertex& x = a.vertices[k];
    const PathVertex& y = b.vertices[k];
    if (x.hit != y.hit || x.delta != y.delta || x.scattering != y.scattering) return false;
  }
  return a.end != PathEnd::Hit ||
         a.vertices[a.scatter_count].hit == b.vertices[b.scatter_count].hit;
}

Vector random_delta(int dimension, double size, Rng& rng) {
  Vector delta(dimension);
  for (int i = 0; i < dimension; ++i) delta[i] = size * rng.normal();
  return delta;
}

/// Kinds of block that the laws of charts have been seen on.
struct BlocksSeen {
  int directions = 0;
  int planes = 0;
  int spheres = 0;

  void add(const Chart& chart) {
    for (int k = 0; k < chart.block_count(); ++k) {
      const Chart::Block& block = chart.block(k);
      ++(block.radius == 0.0 ? planes : block.radius == 1.0 ? directions : spheres);
    }
  }
  void expect_all() const {
    EXPECT_GT(directions, 100);
    EXPECT_GT(planes, 20);
    EXPECT_GT(spheres, 20);
  }
};

// Law: inverse(retract(delta)) = delta, for directions and for points on planar and spherical
// emitters; retract(0) is the base point and every retracted block stays on its manifold.
TEST(Chart, RetractAndInverseRoundTrip) {
  Rng rng(81, Stream::Test, 0);
  BlocksSeen seen;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 500, 81)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      seen.add(chart);
      const int d = chart.dimension();
      ASSERT_EQ(d, path.topology.dimension());
      const PathCoordinates base = chart.retract(Vector::Zero(d));
      for (int k = 0; k < chart.block_count(); ++k)
        EXPECT_LT((base(k) - path.coordinates(k)).norm(), 1e-12);
      for (const double size : {1e-6, 0.1, 2.0}) {
        const Vector delta = random_delta(d, size, rng);
        const PathCoordinates to = chart.retract(delta);
        const auto inverse = chart.inverse(to);
        ASSERT_TRUE(inverse.has_value());
        // Beyond the horizon's neighbourhood rounding grows with the secant of the angle.
        EXPECT_LT((inverse->delta - delta).norm(), 1e-9 * (1.0 + delta.norm()) * size + 1e-13);
        for (int k = 0; k < chart.block_count(); ++k) {
          const Chart::Block& block = chart.block(k);
          const Vec3d center = block.point - block.radius * block.normal;
          if (block.radius == 0.0)
            EXPECT_NEAR(block.normal.dot(to(k) - block.point), 0.0, 1e-12);
          else
            EXPECT_NEAR((to(k) - center).norm(), block.radius, 1e-12);
        }
      }
    }
  }
  seen.expect_all();
}

// Law: a direction beyond the horizon of its tangent plane has no coordinates.
TEST(Chart, NoInverseBeyondTheHorizon) {
  const TestScene& test = test_scenes().front();
  for (const Path& path : light_paths(test, 50, 82)) {
    const Chart chart(test.scene, path.topology, path.coordinates);
    PathCoordinates to = path.coordinates;
    to(0) = -to(0);
    EXPECT_FALSE(chart.inverse(to).has_value());
  }
}

/// Orthonormal tangents of block k's manifold at the point p.
std::array<Vec3d, 2> tangents_at(const Chart::Block& block, const Vec3d& p) {
  const Vec3d center = block.point - block.radius * block.normal;
  const Vec3d n = block.radius == 0.0 ? block.normal : Vec3d((p - center).normalized());
  const TangentBasis basis = tangent_basis(n);
  return {basis.t, basis.b};
}

// Law: log_jacobian is log |det d delta / d X| of the map inverse(), X in solid angle for
// directions and area for emitter points, by central differences.
TEST(Chart, LogJacobianIsTheDeterminant) {
  Rng rng(83, Stream::Test, 0);
  BlocksSeen seen;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 200, 83)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      seen.add(chart);
      const PathCoordinates at = chart.retract(random_delta(chart.dimension(), 0.5, rng));
      double log_determinant = 0;
      for (int k = 0; k < chart.block_count(); ++k) {
        const Chart::Block& block = chart.block(k);
        const std::array<Vec3d, 2> tangents = tangents_at(block, at(k));
        const double h = 1e-5 * block.length;
        Eigen::Matrix2d jacobian;
        for (int j = 0; j < 2; ++j) {
          PathCoordinates plus = at;
          PathCoordinates minus = at;
          plus(k) += h * tangents[static_cast<std::size_t>(j)];
          minus(k) -= h * tangents[static_cast<std::size_t>(j)];
          // A tangential step leaves the sphere by h^2 only, alike for both.
          jacobian.col(j) =
              (chart.inverse(plus)->delta - chart.inverse(minus)->delta).segment<2>(2 * k) /
              (2.0 * h);
        }
        log_determinant += std::log(std::abs(jacobian.determinant()));
      }
      EXPECT_NEAR(chart.inverse(at)->log_jacobian, log_determinant,
                  1e-6 * (1.0 + std::abs(log_determinant)));
    }
  }
  seen.expect_all();
}

// Law: the tangents of a chart are orthogonal to each other and to the normal, of the block's
// length, and turning them keeps that.
TEST(Chart, TangentsAreOrthogonal) {
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 100, 84)) {
      Chart chart(test.scene, path.topology, path.coordinates);
      for (int k = 0; k < chart.block_count(); ++k) {
        chart.rotate(k, 0.7 * k + 0.1);
        const Chart::Block& block = chart.block(k);
        EXPECT_NEAR(block.t.norm(), block.length, 1e-12);
        EXPECT_NEAR(block.b.norm(), block.length, 1e-12);
        EXPECT_NEAR(block.t.dot(block.b), 0.0, 1e-12);
        EXPECT_NEAR(block.t.dot(block.normal), 0.0, 1e-12);
      }
    }
  }
}

// Law: tracing a sampled path along its own coordinates gives the path back.
TEST(Trace, ReproducesSampledPaths) {
  ClassCounter classes;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 3000, 85)) {
      PathTopology traced;
      const TraceStatus status = trace(test.scene, path.topology, path.coordinates, traced);
      EXPECT_EQ(status, TraceStatus::Ok) << test.name;
      if (status != TraceStatus::Ok) continue;
      EXPECT_TRUE(same(traced, path.topology)) << test.name;
      classes.add(classes_of(test.scene, path));
    }
  }
  for (const std::string& missing : classes.missing(5)) ADD_FAILURE() << missing;
}

// Law: tracing is reversible. If a path is reached from another, the other is reached from it, and
// what is reached is traced to itself.
TEST(Trace, IsReversible) {
  Rng rng(86, Stream::Test, 0);
  int reached = 0;
  int changed = 0;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 1500, 86)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      PathDerivatives derivatives;
      differentiate(test.scene, path.topology, chart, {false, true}, derivatives);
      KernelOptions options;
      options.drift = Drift::None;
      const StepDistribution step(options, chart.dimension(),
                                  CholeskyFactor::of(derivatives.q).value(), nullptr, nullptr);
      const PathCoordinates to = chart.retract(step.sample(1.0, rng));
      PathTopology topology;
      if (trace(test.scene, path.topology, to, topology) != TraceStatus::Ok) continue;
      if (!std::isfinite(contribution(test.scene, topology, to).log_target)) continue;
      ++reached;
      if (!same(topology, path.topology)) ++changed;
      PathTopology again;
      EXPECT_EQ(trace(test.scene, topology, to, again), TraceStatus::Ok) << test.name;
      EXPECT_TRUE(same(again, topology)) << test.name;
      PathTopology back;
      EXPECT_EQ(trace(test.scene, topology, path.coordinates, back), TraceStatus::Ok) << test.name;
      EXPECT_TRUE(same(back, path.topology)) << test.name;
    }
  }
  EXPECT_GT(reached, 1000);
  EXPECT_GT(changed, 100);
}

/// Counts scattering events that pass light through a surface by its shading normal alone.
struct LeakCounter : WalkVisitor<double> {
  int leaks = 0;

  void scatter(const ScatterEvent<double>& e) {
    if (!passes(e.at, e.wi, e.wo)) ++leaks;
  }
  void connect(const ScatterEvent<double>& e) { scatter(e); }
  void delta(const ScatterEvent<double>& e) { scatter(e); }
};

// Law: no path, sampled or traced, leaks through interpolated normals: both of its directions lie
// on one side of the geometric and the shading normal.
TEST(Trace, LeaksNoLight) {
  Rng rng(87, Stream::Test, 0);
  for (const TestScene& test : test_scenes()) {
    LeakCounter counter;
    for (const Path& path : light_paths(test, 1500, 87)) {
      walk<double>(test.scene, path.topology, path.coordinates, counter);
      const Chart chart(test.scene, path.topology, path.coordinates);
      const PathCoordinates to = chart.retract(random_delta(chart.dimension(), 0.3, rng));
      PathTopology topology;
      if (trace(test.scene, path.topology, to, topology) != TraceStatus::Ok) continue;
      walk<double>(test.scene, topology, to, counter);
    }
    EXPECT_EQ(counter.leaks, 0) << test.name;
  }
}

/// A floor, a mirror half over it, a light above and a screen beside it.
struct Stage {
  Scene scene;
  PathTopology pattern;

  Stage() : scene(build()) {
    pattern.end = PathEnd::AreaConnection;
    pattern.scatter_count = 1;
    pattern.block_count = 2;
    pattern.emitter = 0;
  }

  static Scene build() {
    SceneBuilder builder;
    const auto white = builder.add_material({builder.add_bsdf(Diffuse{}), std::nullopt});
    const auto mirror = builder.add_material({builder.add_bsdf(Conductor{}), std::nullopt});
    builder.add_shape(quad({-2, 0, 2}, {4, 0, 0}, {0, 0, -4}), white);
    builder.add_shape(quad({-2, 2, -1}, {1, 0, 0}, {0, 0, 1}), white, Rgbd::Ones());
    builder.add_shape(quad({1, 0.1, 1}, {1, 0, 0}, {0, 0, -1}), mirror);
    builder.add_shape(quad({-0.5, 0.5, -2}, {0, 0, 3}, {0, 1, 0}), white);
    builder.set_camera(look_at({0, 1, 4}, {0, 0, 0}, 1.0));
    return builder.build();
  }

  TraceStatus trace_to(const Vec3d& floor, const Vec3d& light) const {
    PathCoordinates coordinates;
    coordinates(0) = (floor - scene.camera().origin).normalized();
    coordinates(1) = light;
    PathTopology result;
    return trace(scene, pattern, coordinates, result);
  }
};

// Law: a trace says why it failed.
TEST(Trace, NamesWhatWentWrong) {
  const Stage stage;
  const Vec3d light(-1.5, 2, -0.5);
  EXPECT_EQ(stage.trace_to({-1, 0, 0}, light), TraceStatus::Ok);
  EXPECT_EQ(stage.trace_to({0.5, 0, 0}, light), TraceStatus::Occluded);
  EXPECT_EQ(stage.trace_to({1.5, 0.1, 0.5}, light), TraceStatus::OtherLobe);
  EXPECT_EQ(stage.trace_to({0, 0, -9}, light), TraceStatus::Missed);
  EXPECT_EQ(stage.trace_to({0, 9, 0}, light), TraceStatus::Missed);
}

// Law: diffuse lobes connect to emitters that have a chart of their own, all else is hit.
TEST(ConnectsToArea, DependsOnLobeAndShapeOnly) {
  for (const TestScene& test : test_scenes()) {
    for (const Shape& shape : test.scene.shapes()) {
      const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry);
      const bool charted = mesh != nullptr ? mesh->triangles.size() == 2
                                           : !std::holds_alternative<Cylinder>(shape.geometry);
      EXPECT_EQ(connects_to_area(lobe_of(Diffuse{}, false), shape), charted);
      for (const Bsdf& bsdf : {Bsdf(Phong{}), Bsdf(RoughConductor{}), Bsdf(RoughDielectric{})})
        EXPECT_FALSE(connects_to_area(lobe_of(bsdf, false), shape));
      // Plastic has a diffuse lobe and a delta one.
      const Bsdf plastic = Plastic(1.5, Texture{}, Texture{}, false);
      EXPECT_EQ(connects_to_area(lobe_of(plastic, false), shape), charted);
      EXPECT_FALSE(connects_to_area(lobe_of(plastic, true), shape));
    }
  }
}

}  // namespace
}  // namespace driftlight::test
