// SPDX-License-Identifier: Apache-2.0
/// Laws of chains of held vertices: they are found where they are, and their density is that of
/// geometrical optics.
#include "manifold_walk.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>

#include "path_mutation.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

/// The first light path that the camera's samples find for which this holds.
std::optional<VertexPath> find_path(const Scene& scene, int max_depth,
                                    const std::function<bool(const VertexPath&)>& holds,
                                    std::uint64_t seed) {
  const PathSampler sampler(scene, max_depth, LargeSteps::Bdpt, 1, PhaseSpace::Bidirectional);
  for (std::uint64_t i = 0; i < 200000; ++i) {
    Rng rng(seed, Stream::Test, i);
    const auto sample = sampler.sample(rng);
    if (!sample) continue;
    VertexPath path = vertex_path(scene, *sample);
    if (path.evaluate(scene) && holds(path)) return path;
  }
  return std::nullopt;
}

bool is_mirror_path(const VertexPath& path) { return path.edges == 2 && path(1).delta; }

/// A camera before a mirror, a wall that shines behind it.
Scene before_mirror(const Geometry& mirror) {
  SceneBuilder builder;
  const auto smooth = builder.add_material({builder.add_bsdf(Conductor{}), std::nullopt});
  const auto black = builder.add_material({builder.add_bsdf(Diffuse{}), std::nullopt});
  builder.add_shape(mirror, smooth);
  builder.add_shape(quad({-9, -9, 6}, {0, 18, 0}, {18, 0, 0}), black, Rgbd::Ones());
  builder.set_camera(look_at({0.5, 0.3, 3}, {0, 0, 0}, 0.3));
  return builder.build();
}

/// prod |cos| / r^2 dx / dw of a camera at distance r before the mirror and a point at s behind it.
double expected_density(const VertexPath& path, double spread_along, double spread_across) {
  const Vec3d last = path.end.p - path(1).surface.at.p;
  return std::exp(path.log_arriving(1)) * std::abs(spread_along * spread_across) /
         last.squaredNorm();
}

// Law: of a plane mirror light spreads as over the whole length, (r + s)^2; of a sphere, by
// Coddington's equations, by r + s + 2 r s / (R cos) in the plane of incidence and by
// r + s + 2 r s cos / R across.
TEST(ManifoldWalk, DensityIsThatOfMirrors) {
  const double radius = 0.8;
  Sphere ball;
  ball.center = {0, 0, 0};
  ball.radius = radius;
  for (const bool plane : {true, false}) {
    const Scene scene =
        before_mirror(plane ? Geometry(quad({-2, -2, 0}, {4, 0, 0}, {0, 4, 0})) : Geometry(ball));
    for (std::uint64_t seed = 401; seed < 406; ++seed) {
      const auto path = find_path(scene, 2, is_mirror_path, seed);
      ASSERT_TRUE(path);
      const Interaction<double>& at = (*path)(1).surface.at;
      const double r = (at.p - scene.camera().origin).norm();
      const double s = (path->end.p - at.p).norm();
      const double cosine = std::abs(at.n_g.dot(path->toward_light(0)));
      const double bend = plane ? 0.0 : 2.0 * r * s / radius;
      const double expected = expected_density(*path, r + s + bend / cosine, r + s + bend * cosine);
      EXPECT_NEAR(ManifoldWalk(scene).log_density(*path, 0, 2), std::log(expected), 1e-9);
    }
  }
}

// Law: through a slab of glass the light of a point spreads, near the normal, as over the distance
// r + d / eta + s.
TEST(ManifoldWalk, DensityIsThatOfASlab) {
  const double eta = 1.5;
  const double depth = 0.4;
  SceneBuilder builder;
  const auto glass = builder.add_material({builder.add_bsdf(Dielectric{.eta = eta}), std::nullopt});
  const auto black = builder.add_material({builder.add_bsdf(Diffuse{}), std::nullopt});
  builder.add_shape(box({-2, -2, -depth}, {2, 2, 0}), glass);
  builder.add_shape(quad({-2, -2, -2}, {4, 0, 0}, {0, 4, 0}), black, Rgbd::Ones());
  builder.set_camera(look_at({0, 0, 3}, {0, 0, 0}, 0.003));
  const Scene scene = builder.build();
  const auto path = find_path(
      scene, 3,
      [](const VertexPath& x) {
        return x.edges == 3 && x(1).delta && x(1).scattering == Scattering::Transmission;
      },
      411);
  ASSERT_TRUE(path);
  const double reach = 3.0 + depth / eta + (2.0 - depth);
  const double last = 2.0 - depth;
  const double expected =
      path->log_arriving(1) + path->log_arriving(2) + 2.0 * std::log(reach / last);
  EXPECT_NEAR(ManifoldWalk(scene).log_density(*path, 0, 3), expected, 1e-4);
}

/// Copies the ends and none of what is between.
VertexPath without_chain(const VertexPath& x, int from, int to) {
  VertexPath y;
  y.edges = x.edges;
  y.end = x.end;
  y(from) = x(from);
  if (to > 0 && to < x.edges) y(to) = x(to);
  return y;
}

// Law: between the ends of a path its held vertices are found where they are, from either end, and
// whatever holds them: smooth and narrow lobes, spheres and meshes.
TEST(ManifoldWalk, FindsTheVerticesOfAPath) {
  int found = 0;
  int chains = 0;
  for (const TestScene& test : test_scenes()) {
    if (!is_pinhole(test.scene.camera())) continue;
    const ManifoldWalk walk(test.scene);
    for (const auto& sample : light_paths(test, 400, 421)) {
      VertexPath x = vertex_path(test.scene, sample);
      if (!x.evaluate(test.scene)) continue;
      const ManifoldSpans spans = manifold_spans(x);
      for (int i = 0; i < spans.count; ++i) {
        const auto& [a, b, c] = spans.all[static_cast<std::size_t>(i)];
        for (const int to : {a, c}) {
          if (std::abs(to - b) == 1) continue;
          ++chains;
          VertexPath y = without_chain(x, b, to);
          if (walk.connect(x, b, to, y) != TraceStatus::Ok) continue;
          ++found;
          const int next = to > b ? b + 1 : b - 1;
          EXPECT_LT((y(next).surface.at.p - x(next).surface.at.p).norm(),
                    1e-6 * test.scene.radius());
          EXPECT_TRUE(walk.leads_back(x, b, to, x));
        }
      }
    }
  }
  EXPECT_GT(chains, 500);
  // What rays in single precision miss at edges and grazing angles is little.
  EXPECT_GT(found, 0.98 * chains);
}

}  // namespace
}  // namespace driftlight::test
