// SPDX-License-Identifier: Apache-2.0
/// Laws of snapshots: they are the images of shorter renders, and leave the render as it is.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "driftlight/render.h"
#include "support/test_scenes.h"
#include "support/tiles.h"

namespace driftlight {
namespace {

struct Renderer {
  std::string name;
  /// Samples per pixel, or mutations.
  std::function<Image(const Scene&, const RenderOptions&, int work)> render;
};

LangevinOptions quick(Mode mode) {
  LangevinOptions options;
  options.mode = mode;
  options.redistribution.pilot = 1024;
  options.splitting.pilot = 256;
  options.bootstrap = 20000;
  options.chains = 16;
  options.direct = DirectLight::Chain;
  options.max_depth = 4;
  return options;
}

Renderer langevin(std::string name, Mode mode) {
  return {std::move(name), [=](const Scene& scene, const RenderOptions& how, int work) {
            return render_langevin(scene, quick(mode), how, work).image;
          }};
}

const std::vector<Renderer> kRenderers{
    {"path", [](const Scene& scene, const RenderOptions& how,
                int work) { return render_path(scene, {.max_depth = 4}, how, work).image; }},
    {"bdpt", [](const Scene& scene, const RenderOptions& how,
                int work) { return render_bdpt(scene, {.max_depth = 4}, how, work).image; }},
    {"light", [](const Scene& scene, const RenderOptions& how,
                 int work) { return render_light(scene, {.max_depth = 4}, how, work).image; }},
    langevin("redistribution", Mode::Redistribution),
    langevin("splitting", Mode::Splitting),
    langevin("chain", Mode::Chain),
};

struct Taken {
  Image image;  ///< of the render
  std::vector<Snapshot> snapshots;
};

Taken render(const Renderer& renderer, const Scene& scene, const std::vector<double>& at, int work,
             int threads = 1) {
  Taken taken;
  RenderOptions how;
  how.threads = threads;
  how.seed = 4;
  how.snapshot_at = at;
  how.snapshot = [&](Snapshot snapshot) { taken.snapshots.push_back(std::move(snapshot)); };
  taken.image = renderer.render(scene, how, work);
  return taken;
}

/// Equal but for the rounding of splats.
void expect_near(const Image& a, const Image& b, float tolerance) {
  ASSERT_EQ(a.rgb.size(), b.rgb.size());
  for (std::size_t i = 0; i < a.rgb.size(); ++i)
    ASSERT_NEAR(a.rgb[i], b.rgb[i], tolerance * std::max(1.0F, b.rgb[i])) << i;
}

TEST(Snapshots, AreTheImagesOfLessWork) {
  const Scene scene = test::limelight();
  for (const Renderer& renderer : kRenderers) {
    SCOPED_TRACE(renderer.name);
    const bool chain = renderer.name == "chain";
    const float tolerance = chain ? 1e-5F : 0.0F;
    const Taken taken = render(renderer, scene, {0.25, 0.5, 1.0}, 16);
    ASSERT_EQ(taken.snapshots.size(), 3U);
    EXPECT_EQ(taken.snapshots[0].fraction, 0.25);
    EXPECT_EQ(taken.snapshots[1].fraction, 0.5);
    EXPECT_EQ(taken.snapshots[2].fraction, 1.0);
    for (const Snapshot& snapshot : taken.snapshots) {
      EXPECT_EQ(snapshot.work, 16 * snapshot.fraction);
      EXPECT_GT(snapshot.seconds, 0.0);
    }
    EXPECT_LT(taken.snapshots[0].seconds, taken.snapshots[2].seconds);
    expect_near(taken.snapshots[2].image, taken.image, 0.0F);
    expect_near(taken.snapshots[1].image, render(renderer, scene, {}, 8).image, tolerance);
    EXPECT_NE(taken.snapshots[1].image.rgb, taken.image.rgb);
  }
}

TEST(Snapshots, LeaveTheImageAsItIs) {
  const Scene scene = test::limelight();
  for (const Renderer& renderer : kRenderers) {
    SCOPED_TRACE(renderer.name);
    const Taken with = render(renderer, scene, {0.1, 0.3, 1.0}, 8);
    expect_near(with.image, render(renderer, scene, {}, 8).image,
                renderer.name == "chain" ? 1e-5F : 0.0F);
    // And like it do not depend on threads.
    const Taken threads = render(renderer, scene, {0.1, 0.3, 1.0}, 8, 2);
    ASSERT_EQ(threads.snapshots.size(), with.snapshots.size());
    for (std::size_t i = 0; i < with.snapshots.size(); ++i)
      EXPECT_EQ(threads.snapshots[i].image.rgb, with.snapshots[i].image.rgb) << i;
  }
}

TEST(Snapshots, ComeOnceWhereOnePassIsAllOfSeveral) {
  const Taken taken =
      render(kRenderers.front(), test::limelight(), {0.125, 0.25, 0.5, 0.75, 1.0}, 2);
  ASSERT_EQ(taken.snapshots.size(), 2U);
  EXPECT_EQ(taken.snapshots[0].fraction, 0.5);
  EXPECT_EQ(taken.snapshots[1].fraction, 1.0);
}

TEST(Snapshots, TakeNoneOfTheTime) {
  const Scene scene = test::limelight();
  for (const Renderer& renderer : kRenderers) {
    SCOPED_TRACE(renderer.name);
    std::vector<Snapshot> snapshots;
    RenderOptions how;
    how.time = 2.0;  // longer than a bootstrap takes under sanitizers beside another test
    how.snapshot_at = {0.75, 1.0};
    how.snapshot = [&](Snapshot snapshot) {
      snapshots.push_back(std::move(snapshot));
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
    };
    const auto start = std::chrono::steady_clock::now();
    renderer.render(scene, how, 1);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    ASSERT_EQ(snapshots.size(), 2U);
    EXPECT_GE(snapshots[0].seconds, 1.5);
    EXPECT_GE(snapshots[1].seconds, 2.0);
    EXPECT_GE(elapsed.count(), snapshots[1].seconds + 1.0 - 0.01);
    EXPECT_GT(snapshots[1].work, snapshots[0].work);
  }
}

}  // namespace
}  // namespace driftlight
