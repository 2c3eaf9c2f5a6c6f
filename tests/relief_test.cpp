// SPDX-License-Identifier: Apache-2.0
/// Laws of bump and normal maps.
#include "driftlight/relief.h"

#include <gtest/gtest.h>

#include "driftlight/error.h"
#include "driftlight/hand_relief.h"
#include "driftlight/random.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

Relief relief_of(Relief::Kind kind, double scale) {
  Relief relief{kind, {}, scale};
  relief.texture.bitmap = pattern_bitmap(5, 7, 0.3, 0.8);
  relief.texture.uv_to_texture << 1.3, -0.4, 0.7, 0.9;
  return relief;
}

Interaction<double> meet(const TriangleMesh& mesh, const Vec3d& p) {
  const Ray<double> ray{p + Vec3d(0, 0, 1), Vec3d(0, 0, -1)};
  return interact(Geometry(mesh), 0, ray, true);
}

Vec3d relieved(const Relief& relief, const TriangleMesh& mesh, const Vec3d& p) {
  Interaction<double> at = meet(mesh, p);
  relieve(relief, mesh, 0, at);
  return at.n_s;
}

/// A triangle in the plane z = 0, or with bent normals; its uvs mirror the plane if `mirrored`.
TriangleMesh triangle(bool bent, bool mirrored) {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0.2F, 0}, {0.1F, 0.9F, 0}};
  mesh.triangles = {{0, 1, 2}};
  mesh.uvs = {{0.1F, 0.2F}, {0.8F, 0.3F}, {0.3F, 0.9F}};
  if (mirrored) std::swap(mesh.uvs[1], mesh.uvs[2]);
  if (bent) mesh.normals = {{-0.2F, -0.1F, 1}, {0.3F, 0.1F, 1}, {0, 0.2F, 1}};
  return mesh;
}

// Law: the normal of bumps on a plane is that of the surface raised by the heights.
TEST(Relief, BumpsAreARaisedSurface) {
  const Relief relief = relief_of(Relief::Kind::Bumps, -0.3);
  for (const bool mirrored : {false, true}) {
    const TriangleMesh mesh = triangle(false, mirrored);
    const auto raised = [&](double x, double y) {
      const Vec3d p(x, y, 0);
      const double height = relief.scale * luminance(relief.texture.eval(meet(mesh, p).uv));
      return Vec3d(p + height * Vec3d::UnitZ());
    };
    for (const auto& [x, y] : {std::pair{0.3, 0.3}, {0.41, 0.2}, {0.2, 0.44}}) {
      const double h = 1e-6;
      const Vec3d by_x = raised(x + h, y) - raised(x - h, y);
      const Vec3d by_y = raised(x, y + h) - raised(x, y - h);
      const Vec3d expected = by_x.cross(by_y).normalized();
      EXPECT_LT((relieved(relief, mesh, {x, y, 0}) - expected).norm(), 1e-8) << mirrored;
      EXPECT_GT((expected - Vec3d::UnitZ()).norm(), 0.01);
    }
  }
}

// Law: heights that do not change leave bent normals as they are to first order in the bend, and
// exactly on a plane; the middle blue of normal maps leaves any.
TEST(Relief, FlatMapsChangeNothing) {
  Relief bumps;
  bumps.texture = Texture(Rgbd(0.3, 0.4, 0.5));
  const Vec3d p(0.3, 0.3, 0);
  EXPECT_LT((relieved(bumps, triangle(false, true), p) - Vec3d::UnitZ()).norm(), 1e-12);
  Relief normals{Relief::Kind::Normals, Texture(Rgbd(0.5, 0.5, 1.0)), 1.0};
  for (const bool bent : {false, true}) {
    const TriangleMesh mesh = triangle(bent, false);
    EXPECT_LT((relieved(normals, mesh, p) - meet(mesh, p).n_s).norm(), 1e-12);
    EXPECT_LT((shading_normal(mesh, 0, p) - meet(mesh, p).n_s).norm(), 1e-12);
  }
}

// Law: a normal map's frame is dp/du, made orthogonal to the shading normal, what completes it to a
// right-handed one, and that normal.
TEST(Relief, NormalMapsAreInTheFrameOfTheSurface) {
  const TriangleMesh mesh = triangle(true, false);
  const Vec3d p(0.3, 0.3, 0);
  const Vec3d n = meet(mesh, p).n_s;
  const Vec3d p_u = surface_tangents(mesh, 0)->u;
  const Vec3d s = (p_u - n.dot(p_u) * n).normalized();
  const Vec3d local = Vec3d(0.4, -0.3, 0.8).normalized();
  const Relief relief{Relief::Kind::Normals, Texture(Rgbd(0.5 + 0.5 * local.array())), 1.0};
  const Vec3d expected = local.x() * s + local.y() * n.cross(s) + local.z() * n;
  EXPECT_LT((relieved(relief, mesh, p) - expected).norm(), 1e-12);
}

// Law: tangents are the derivatives of the position by u and by v.
TEST(Relief, TangentsAreDerivatives) {
  for (const bool mirrored : {false, true}) {
    const TriangleMesh mesh = triangle(false, mirrored);
    const auto tangents = surface_tangents(mesh, 0);
    ASSERT_TRUE(tangents);
    const Vec3d p(0.3, 0.3, 0);
    const Vec2d uv = meet(mesh, p).uv;
    EXPECT_LT((meet(mesh, p + 0.1 * tangents->u).uv - uv - Vec2d(0.1, 0)).norm(), 1e-7);
    EXPECT_LT((meet(mesh, p + 0.1 * tangents->v).uv - uv - Vec2d(0, 0.1)).norm(), 1e-7);
  }
  TriangleMesh without = triangle(false, false);
  without.uvs = {{0, 0}, {0.5F, 0.5F}, {1, 1}};
  EXPECT_FALSE(surface_tangents(without, 0));
}

// Law: the differential by hand, (H35) and (H36), is that of Jets, on both sides of the surface.
TEST(Relief, DifferentialByHandIsThatOfJets) {
  using J = ceres::Jet<double, 3>;
  Rng rng(151, Stream::Test, 0);
  for (const Relief::Kind kind : {Relief::Kind::Bumps, Relief::Kind::Normals}) {
    const Relief relief = relief_of(kind, 0.2);
    for (const bool bent : {false, true}) {
      const TriangleMesh mesh = triangle(bent, bent);
      for (int i = 0; i < 50; ++i) {
        const double x = 0.1 + 0.4 * rng.uniform();
        const double y = 0.1 + 0.4 * rng.uniform();
        const Ray<J> ray{{J(x, 0), J(y, 1), J(1.0)}, {J(0.0), J(0.0), J(-1.0)}};
        Interaction<J> jets = interact(Geometry(mesh), 0, ray, true);
        relieve(relief, mesh, 0, jets);
        const Vec3d p(x, y, 0);
        for (const double side : {1.0, -1.0}) {
          const Vec3d n_s = side * value(jets.n_s);
          const SurfaceDifferential hand =
              hand::relieved_surface<HandRules>(relief, mesh, 0, p, meet(mesh, p).uv, n_s);
          for (int k = 0; k < 2; ++k) {
            const Vec3d dx = Vec3d::Unit(k);
            const Vec3d dn = hand.a1 * hand.c1.dot(dx) + hand.a2 * hand.c2.dot(dx);
            const Vec3d expected(jets.n_s.x().v[k], jets.n_s.y().v[k], jets.n_s.z().v[k]);
            EXPECT_LT((dn - side * expected).norm(), 1e-10);
          }
        }
      }
    }
  }
}

// Law: only meshes with texture coordinates carry relief.
TEST(Relief, NeedsTextureCoordinates) {
  SceneBuilder builder;
  Material material{builder.add_bsdf(Diffuse{}), std::nullopt,
                    std::make_shared<const Relief>(relief_of(Relief::Kind::Bumps, 1.0))};
  const auto index = builder.add_material(material);
  EXPECT_THROW(builder.add_shape(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, false), index), InputError);
  EXPECT_THROW(builder.add_shape(Sphere{}, index), InputError);
  EXPECT_NO_THROW(builder.add_shape(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, true), index));
}

}  // namespace
}  // namespace driftlight::test
