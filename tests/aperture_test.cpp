// SPDX-License-Identifier: Apache-2.0
/// Laws of apertures: the width of holes of known size, nothing in the open, and rows that are the
/// derivatives of what they say.
#include "driftlight/aperture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "driftlight/divergence.h"
#include "driftlight/scene_file.h"
#include "driftlight/small_step.h"
#include "driftlight/walk.h"
#include "support/dense.h"
#include "support/places.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

/// A wall at z = distance with a hole of 2 a x 2 b, turned by `angle` about z, between a floor of
/// rough metal at z = 0 and a lamp that fills the plane z = 4.
struct Hole {
  double distance;
  double a;
  double b;
  double angle;

  Vec3d axis() const { return {std::cos(angle), std::sin(angle), 0.0}; }
  Vec3d across() const { return {-std::sin(angle), std::cos(angle), 0.0}; }
  Vec3d point(double x, double y) const {
    return x * axis() + y * across() + Vec3d(0, 0, distance);
  }
};

constexpr double kFar = 40;

/// `sides` of the wall: 4 leave a hole, 2 a slit across the axis, 1 an edge, 0 nothing.
Scene scene_with(const Hole& hole, int sides) {
  SceneBuilder builder;
  const auto metal = builder.add_material(
      {builder.add_bsdf(RoughConductor{
           {Distribution::Beckmann, 0.5}, {0.2, 0.9, 1.1}, {3.9, 2.4, 2.2}, Texture(Rgbd::Ones())}),
       std::nullopt});
  const auto black = builder.add_bsdf(Diffuse{Texture(Rgbd::Zero())});
  const auto dark = builder.add_material({black, black});
  builder.add_shape(quad({-kFar, -kFar, 0}, {2 * kFar, 0, 0}, {0, 2 * kFar, 0}), metal);
  builder.add_shape(quad({-kFar, kFar, 4}, {2 * kFar, 0, 0}, {0, -2 * kFar, 0}), dark,
                    Rgbd::Ones());
  const auto wall = [&](double x0, double x1, double y0, double y1) {
    builder.add_shape(quad(hole.point(x0, y0), (x1 - x0) * hole.axis(), (y1 - y0) * hole.across()),
                      dark);
  };
  if (sides > 0) wall(hole.a, kFar, -kFar, kFar);
  if (sides > 1) wall(-kFar, -hole.a, -kFar, kFar);
  if (sides > 2) wall(-hole.a, hole.a, hole.b, kFar);
  if (sides > 3) wall(-hole.a, hole.a, -kFar, -hole.b);
  builder.set_camera(look_at({3.0, 0.1, 0.2}, {0, 0, 0}, 1.0));
  return builder.build();
}

/// The path from the sensor to `floor`, and on to the lamp by way of `through`.
PathSampler::Sample path_through(const Scene& scene, const Vec3d& floor, const Vec3d& through) {
  PathSampler::Sample path;
  PathTopology pattern;
  pattern.scatter_count = 1;
  pattern.block_count = 2;
  pattern.end = PathEnd::Hit;
  path.coordinates(0) = (floor - scene.camera().origin).normalized();
  path.coordinates(1) = (through - floor).normalized();
  EXPECT_EQ(trace(scene, pattern, path.coordinates, path.topology), TraceStatus::Ok);
  return path;
}

Apertures apertures_of(const Scene& scene, const PathSampler::Sample& path) {
  return find_apertures(scene, path.topology, path.coordinates);
}

const std::vector<Hole> kHoles{{1.0, 0.1, 0.1, 0.0},   {2.0, 0.1, 0.1, 0.5},
                               {3.0, 0.1, 0.1, 1.1},   {1.0, 0.03, 0.03, 0.8},
                               {2.0, 0.04, 0.04, 0.2}, {1.5, 0.15, 0.15, 0.35}};

// Law: a slit of half width a at distance t has the precision 3 t^2 / a^2 across and none along,
// wherever in the slit the segment passes and however the slit is turned. A rung is 14 % of a
// slope.
TEST(Aperture, WidthOfASlit) {
  for (const Hole& hole : kHoles) {
    const Scene scene = scene_with(hole, 2);
    for (const double x : {0.0, -0.4, 0.7}) {
      const Vec3d through = hole.point(x * hole.a, 0.0);
      const Vec3d floor(through.x(), through.y(), 0.0);
      const Apertures found = apertures_of(scene, path_through(scene, floor, through));
      ASSERT_EQ(found.count(), 1);
      EXPECT_EQ(found[0].segment, 1);
      EXPECT_NEAR(found[0].kappa * hole.distance, 1.0, 1e-3);
      const double width = hole.a / hole.distance;
      EXPECT_NEAR(found[0].rows[0].norm() * width / std::sqrt(3.0), 1.0, 0.1);
      EXPECT_GT(std::abs(found[0].rows[0].normalized().dot(hole.axis())), 0.97);
      EXPECT_LT(found[0].rows[1].norm(), 0.3 * found[0].rows[0].norm());
    }
  }
}

// Law: a square hole is narrow in all directions, within what three axes tell of its corners.
TEST(Aperture, WidthOfAHole) {
  for (const Hole& hole : kHoles) {
    const Scene scene = scene_with(hole, 4);
    for (const Vec2d& x : {Vec2d(0, 0), Vec2d(-0.5, 0.3), Vec2d(0.8, 0.8), Vec2d(0, -0.9)}) {
      const Vec3d through = hole.point(x.x() * hole.a, x.y() * hole.b);
      const Vec3d floor(through.x(), through.y(), 0.0);
      const Apertures found = apertures_of(scene, path_through(scene, floor, through));
      ASSERT_EQ(found.count(), 1);
      EXPECT_NEAR(found[0].kappa * hole.distance, 1.0, 1e-3);
      const double width = hole.a / hole.distance;
      for (const Vec3d& row : found[0].rows) {
        EXPECT_NEAR(row.dot(Vec3d::UnitZ()), 0.0, 1e-9 * row.norm());
        EXPECT_GT(row.norm() * width / std::sqrt(3.0), 0.65) << x.transpose();
        EXPECT_LT(row.norm() * width / std::sqrt(3.0), 1.15) << x.transpose();
      }
    }
  }
}

// Law: where nothing is in front, or an edge on one side only, or an opening wider than the probes,
// there is no aperture; nor does one come from the far side of a closed room.
TEST(Aperture, NoneInTheOpen) {
  const Hole hole{1.0, 0.1, 0.1, 0.4};
  for (const int sides : {0, 1}) {
    const Scene scene = scene_with(hole, sides);
    const Vec3d through = hole.point(0.02, 0.05);
    EXPECT_EQ(apertures_of(scene, path_through(scene, {0, 0, 0}, through)).count(), 0);
  }
  const Hole wide{1.0, 0.9, 0.9, 0.4};
  const Scene scene = scene_with(wide, 4);
  EXPECT_EQ(apertures_of(scene, path_through(scene, {0, 0, 0}, {0, 0, 1})).count(), 0);

  const TestScene closed{"furnace", furnace(0.5), 5};
  for (const PathSampler::Sample& path : light_paths(closed, 300, 61))
    EXPECT_EQ(apertures_of(closed.scene, path).count(), 0);
}

/// kappa x + v of one segment that leaves x along v.
class SegmentVisitor : public WalkVisitor<double> {
 public:
  SegmentVisitor(int segment, double kappa) : segment_(segment), kappa_(kappa) {}
  const Vec3d& ray() const { return ray_; }

  void depart(const Ray<double>& ray, const Vec3d&) { leave(ray.origin, ray.direction); }
  void depart_parallel(const Ray<double>& ray) { leave(ray.origin, ray.direction); }
  void connect(const ScatterEvent<double>& e) { leave(e.at.p, e.wo); }

 private:
  void leave(const Vec3d& x, const Vec3d& v) {
    if (count_++ == segment_) ray_ = kappa_ * x + v;
  }

  int segment_;
  double kappa_;
  int count_ = 0;
  Vec3d ray_ = Vec3d::Zero();
};

Vec3d ray_of(const Scene& scene, const PathTopology& topology, const PathCoordinates& at,
             const Aperture& aperture) {
  SegmentVisitor visitor(aperture.segment, aperture.kappa);
  walk<double>(scene, topology, at, visitor);
  return visitor.ray();
}

/// An aperture that may be anywhere: rows across the segment, of the size of 1.
Aperture any_aperture(const Scene& scene, const PathSampler::Sample& path, int segment, Rng& rng) {
  Aperture aperture;
  aperture.segment = segment;
  const Vec3d v = ray_of(scene, path.topology, path.coordinates, aperture).normalized();
  aperture.kappa = 0.3 + rng.uniform();
  const TangentBasis basis = tangent_basis(v);
  for (Vec3d& row : aperture.rows) row = rng.normal() * basis.t + rng.normal() * basis.b;
  return aperture;
}

// Law: an aperture on any segment, of paths of every kind, adds J^T J / 9 to Q with J the
// derivatives of rows . (kappa x + v), here by differences; by jets and by hand alike.
TEST(Aperture, RowsAreDerivatives) {
  Rng rng(62, Stream::Test, 0);
  int compared = 0;
  for (const TestScene& test : test_scenes()) {
    for (const PathSampler::Sample& path : light_paths(test, 100, 62)) {
      const Chart chart(test.scene, path.topology, path.coordinates);
      const int segments = path.topology.length();
      Apertures apertures;
      Matrix added = Matrix::Zero(chart.dimension(), chart.dimension());
      for (int k = 0; k < segments; ++k) {
        const Aperture aperture = any_aperture(test.scene, path, k, rng);
        apertures.add(aperture);
        Matrix rays(3, chart.dimension());
        for (int j = 0; j < chart.dimension(); ++j) {
          const auto slope = [&](double h) -> Vec3d {
            const Vector step = h * Vector::Unit(chart.dimension(), j);
            const PathCoordinates ahead = chart.retract(step);
            const PathCoordinates behind = chart.retract(-step);
            const Vec3d difference = ray_of(test.scene, path.topology, ahead, aperture) -
                                     ray_of(test.scene, path.topology, behind, aperture);
            return difference / (2.0 * h);
          };
          const Vec3d coarse = slope(1e-5);
          const Vec3d fine = slope(5e-6);
          for (int i = 0; i < 3; ++i) rays(i, j) = (4.0 * fine[i] - coarse[i]) / 3.0;
        }
        for (const Vec3d& row : aperture.rows) {
          const Vector jacobian =
              (row.x() * rays.row(0) + row.y() * rays.row(1) + row.z() * rays.row(2)).transpose() /
              3.0;
          added += jacobian * jacobian.transpose();
        }
      }
      if (!added.allFinite() || added.norm() > 1e4) continue;
      for (const DerivativeMethod method : {DerivativeMethod::Jet, DerivativeMethod::Hand}) {
        Linearization linear;
        linearize(test.scene, path.topology, chart, method, {}, linear);
        const Matrix q = constraint_matrix(linear);
        constrain(test.scene, path.topology, chart, apertures, linear);
        const Matrix difference = constraint_matrix(linear) - q - added;
        EXPECT_LT(difference.norm(), 1e-5 * added.norm() + 1e-12 * q.norm()) << test.name;
        const Vector x = Vector::Ones(chart.dimension());
        const Vector expected = constraint_matrix(linear) * x;
        EXPECT_LT((apply_constraints(linear, x) - expected).norm(), 1e-10 * expected.norm());
      }
      ++compared;
    }
  }
  EXPECT_GT(compared, 400);
}

LoadedScene small_hole() { return load_scene(test::own_scene("small_hole")); }

// Law: the step of a state is a function of the state: whatever was found before, a path has the
// same apertures and the same density, to the last bit; and the option makes the difference.
TEST(Aperture, StepIsAFunctionOfTheState) {
  const TestScene test{"small_hole", small_hole().scene, 5};
  KernelOptions options;
  options.aperture = true;
  KernelOptions without;
  int narrowed = 0;
  for (const PathSampler::Sample& path : light_paths(test, 300, 63)) {
    ChainState one;
    one.topology = path.topology;
    one.coordinates = path.coordinates;
    ChainState other = one;
    prepare_step(test.scene, without, one);
    const Vector delta = Vector::Constant(one.chart.dimension(), 0.01);
    const double plain = one.step.log_density(delta, 0.1);
    prepare_step(test.scene, options, one);
    prepare_step(test.scene, options, other);
    const double density = one.step.log_density(delta, 0.1);
    EXPECT_EQ(density, other.step.log_density(delta, 0.1));
    const bool found = apertures_of(test.scene, path).count() > 0;
    EXPECT_EQ(density != plain, found);
    if (found) ++narrowed;
  }
  EXPECT_GT(narrowed, 50);
}

// Law: the divergence with apertures that are held is that of the whole Q.
TEST(Aperture, DivergenceSeesTheRows) {
  const TestScene test{"small_hole", small_hole().scene, 4};
  int compared = 0;
  for (const PathSampler::Sample& path : light_paths(test, 60, 64)) {
    const Apertures apertures = apertures_of(test.scene, path);
    if (apertures.count() == 0) continue;
    const Chart chart(test.scene, path.topology, path.coordinates);
    const auto inverse_at = [&](const Chart& at) {
      Linearization linear;
      linearize(test.scene, path.topology, at, DerivativeMethod::Hand, {false, true}, linear);
      constrain(test.scene, path.topology, at, apertures, linear);
      return inverse(constraint_matrix(linear));
    };
    Vector expected = Vector::Zero(chart.dimension());
    for (int j = 0; j < chart.dimension(); ++j) {
      const double h = 1e-5;
      const Vector step = h * Vector::Unit(chart.dimension(), j);
      expected += (inverse_at(chart.displaced(step)) - inverse_at(chart.displaced(-step))).col(j) /
                  (2.0 * h);
    }
    const Vector found =
        divergence(test.scene, path.topology, chart, DerivativeMethod::Hand, apertures);
    EXPECT_LT((found - expected).norm(), 1e-3 * (1.0 + expected.norm()));
    ++compared;
  }
  EXPECT_GT(compared, 10);
}

}  // namespace
}  // namespace driftlight::test
