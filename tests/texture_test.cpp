// SPDX-License-Identifier: Apache-2.0
/// Laws of textures: derivatives belong to values, for every kind, mapping and edge.
#include "driftlight/texture.h"

#include <gtest/gtest.h>

#include <cmath>

#include "driftlight/finite_difference.h"
#include "driftlight/random.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

Texture mapped(Wrap wrap_u, Wrap wrap_v) {
  Texture texture;
  texture.bitmap = pattern_bitmap(5, 7, 0.2, 0.9);
  texture.uv_to_texture << 1.3, -0.4, 0.7, 0.9;
  texture.uv_offset = {0.21, -0.37};
  texture.wrap_u = wrap_u;
  texture.wrap_v = wrap_v;
  texture.scale = {0.5, 0.8, 1.2};
  return texture;
}

Texture two_colors(TwoColors::Layout layout) {
  Texture texture;
  texture.pattern = TwoColors{layout, {0.1, 0.2, 0.3}, {0.9, 0.8, 0.7}, 0.1};
  texture.scale = {1, 0.5, 2};
  return texture;
}

Rgbd eval(const Texture& texture, const Vec2d& uv) { return texture.eval<double>(uv); }

/// The place in texels, of which the derivative jumps where it is at a centre.
double distance_from_seam(const Texture& texture, const Vec2d& uv) {
  const Vec2d p = texture.uv_to_texture * uv + texture.uv_offset;
  const double x = p.x() * texture.bitmap->width - 0.5;
  const double y = p.y() * texture.bitmap->height - 0.5;
  return std::min(std::abs(x - std::round(x)), std::abs(y - std::round(y)));
}

// Law: slopes are the derivatives of eval, by differences and by Jets, inside the bitmap and
// beyond.
TEST(Texture, SlopesAreItsDerivatives) {
  using J = ceres::Jet<double, 2>;
  Rng rng(141, Stream::Test, 0);
  constexpr Wrap kWraps[] = {Wrap::Repeat, Wrap::Clamp, Wrap::Mirror, Wrap::Zero, Wrap::One};
  int compared = 0;
  for (const Wrap wrap_u : kWraps) {
    for (const Wrap wrap_v : kWraps) {
      const Texture texture = mapped(wrap_u, wrap_v);
      for (int i = 0; i < 200; ++i) {
        const Vec2d uv(4.0 * rng.uniform() - 2.0, 4.0 * rng.uniform() - 2.0);
        if (distance_from_seam(texture, uv) < 0.02) continue;
        ++compared;
        const Texture::Slopes slopes = texture.slopes(uv);
        const Rgb<J> jet = texture.eval<J>({J(uv.x(), 0), J(uv.y(), 1)});
        for (int c = 0; c < 3; ++c) {
          const auto along = [&](const Vec2d& direction) {
            return ridders([&](double s) { return eval(texture, uv + s * direction)[c]; }, 1e-3)
                .value;
          };
          EXPECT_NEAR(slopes.u[c], along({1, 0}), 1e-9);
          EXPECT_NEAR(slopes.v[c], along({0, 1}), 1e-9);
          EXPECT_NEAR(jet[c].v[0], slopes.u[c], 1e-12);
          EXPECT_NEAR(jet[c].v[1], slopes.v[c], 1e-12);
          EXPECT_EQ(jet[c].a, eval(texture, uv)[c]);
        }
      }
    }
  }
  EXPECT_GT(compared, 3000);
}

// Law: curvatures are the derivatives of the slopes, by Jets.
TEST(Texture, CurvaturesAreTheDerivativesOfItsSlopes) {
  using J = ceres::Jet<double, 2>;
  Rng rng(143, Stream::Test, 0);
  const Texture texture = mapped(Wrap::Repeat, Wrap::Mirror);
  for (int i = 0; i < 200; ++i) {
    const Vec2d uv(4.0 * rng.uniform() - 2.0, 4.0 * rng.uniform() - 2.0);
    const auto slopes = texture.slopes(Vec2<J>(J(uv.x(), 0), J(uv.y(), 1)));
    const Texture::Curvatures curvatures = texture.curvatures(uv);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(slopes.u[c].v[0], curvatures.uu[c], 1e-12);
      EXPECT_NEAR(slopes.u[c].v[1], curvatures.uv[c], 1e-12);
      EXPECT_NEAR(slopes.v[c].v[0], curvatures.uv[c], 1e-12);
      EXPECT_NEAR(slopes.v[c].v[1], curvatures.vv[c], 1e-12);
    }
  }
}

// Law: beyond its edges a bitmap is what its mode says.
TEST(Texture, WrapsAtItsEdges) {
  const auto bitmap = pattern_bitmap(4, 4, 0.2, 0.9);
  const auto at = [&](Wrap wrap, int x) {
    Texture texture;
    texture.bitmap = bitmap;
    texture.wrap_u = wrap;
    return eval(texture, {(x + 0.5) / 4.0, 0.375});  // a centre of row 1
  };
  const auto texel = [&](int x) { return Rgbd(bitmap->at(x, 1).cast<double>()); };
  const auto expect_equal = [](const Rgbd& a, const Rgbd& b) {
    EXPECT_LT((a - b).matrix().norm(), 1e-7) << a.transpose() << " and " << b.transpose();
  };
  for (int x = 0; x < 4; ++x)
    for (const Wrap wrap : {Wrap::Repeat, Wrap::Clamp, Wrap::Mirror, Wrap::Zero, Wrap::One})
      expect_equal(at(wrap, x), texel(x));
  expect_equal(at(Wrap::Repeat, -1), texel(3));
  expect_equal(at(Wrap::Repeat, 9), texel(1));
  expect_equal(at(Wrap::Clamp, -2), texel(0));
  expect_equal(at(Wrap::Clamp, 6), texel(3));
  expect_equal(at(Wrap::Mirror, -1), texel(0));
  expect_equal(at(Wrap::Mirror, -3), texel(2));
  expect_equal(at(Wrap::Mirror, 4), texel(3));
  expect_equal(at(Wrap::Mirror, 8), texel(0));
  expect_equal(at(Wrap::Zero, 4), Rgbd::Zero());
  expect_equal(at(Wrap::One, -1), Rgbd::Ones());
}

TEST(Texture, FarCoordinatesStayInTheBitmap) {
  for (const Wrap wrap : {Wrap::Repeat, Wrap::Clamp, Wrap::Mirror, Wrap::Zero, Wrap::One}) {
    const Texture texture = mapped(wrap, wrap);
    for (const double far : {1e9, -1e12, 1e300})
      EXPECT_TRUE(eval(texture, {far, -far}).isFinite().all() || far > 1e20);
  }
}

// Law: the nearest texel is a square of one colour.
TEST(Texture, NearestTexelsAreSquares) {
  Texture texture;
  texture.bitmap = pattern_bitmap(4, 4, 0.2, 0.9);
  texture.interpolates = false;
  for (const double u : {0.251, 0.3, 0.499}) {
    const Rgbd expected = texture.bitmap->at(1, 2).cast<double>();
    EXPECT_EQ((eval(texture, {u, 0.6}) - expected).matrix().norm(), 0.0);
    EXPECT_EQ(texture.slopes(Vec2d(u, 0.6)).u.matrix().norm(), 0.0);
  }
}

TEST(Texture, CheckerboardsAlternate) {
  const Texture texture = two_colors(TwoColors::Layout::Checkerboard);
  const Rgbd color0 = texture.scale * texture.pattern->color0;
  const Rgbd color1 = texture.scale * texture.pattern->color1;
  EXPECT_EQ((eval(texture, {0.2, 0.3}) - color0).matrix().norm(), 0.0);
  EXPECT_EQ((eval(texture, {0.7, 0.3}) - color1).matrix().norm(), 0.0);
  EXPECT_EQ((eval(texture, {-0.2, -0.3}) - color0).matrix().norm(), 0.0);
  EXPECT_EQ((eval(texture, {-0.2, 1.3}) - color1).matrix().norm(), 0.0);
  EXPECT_FALSE(texture.is_constant());
}

TEST(Texture, GridsHaveLinesAroundTheIntegers) {
  const Texture texture = two_colors(TwoColors::Layout::Grid);
  const Rgbd color0 = texture.scale * texture.pattern->color0;
  const Rgbd color1 = texture.scale * texture.pattern->color1;
  EXPECT_EQ((eval(texture, {0.5, 0.5}) - color0).matrix().norm(), 0.0);
  EXPECT_EQ((eval(texture, {0.05, 0.5}) - color1).matrix().norm(), 0.0);
  EXPECT_EQ((eval(texture, {0.5, -0.05}) - color1).matrix().norm(), 0.0);
  EXPECT_EQ((eval(texture, {2.93, 0.5}) - color1).matrix().norm(), 0.0);
  EXPECT_EQ((eval(texture, {0.12, 0.88}) - color0).matrix().norm(), 0.0);
}

// Law: the average is the mean over a period, and nothing exceeds the maximum.
TEST(Texture, KnowsItsAverageAndMaximum) {
  Rng rng(142, Stream::Test, 0);
  Texture bitmap = mapped(Wrap::Repeat, Wrap::Repeat);
  bitmap.uv_to_texture.setIdentity();
  for (const Texture& texture :
       {bitmap, two_colors(TwoColors::Layout::Checkerboard), two_colors(TwoColors::Layout::Grid)}) {
    Rgbd sum = Rgbd::Zero();
    Rgbd largest = Rgbd::Zero();
    const int count = 40000;
    for (int i = 0; i < count; ++i) {
      const Rgbd color = eval(texture, {rng.uniform(), rng.uniform()});
      sum += color;
      largest = largest.max(color);
    }
    EXPECT_LT((sum / count - texture.average()).matrix().norm(), 0.02);
    EXPECT_TRUE((largest <= texture.maximum_color() + 1e-9).all());
    EXPECT_LT((largest - texture.maximum_color()).matrix().norm(), 0.1);
  }
}

}  // namespace
}  // namespace driftlight::test
