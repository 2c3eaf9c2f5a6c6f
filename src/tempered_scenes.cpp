// SPDX-License-Identifier: Apache-2.0
#include "tempered_scenes.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

/// Standard deviation of the softest environment, radians: from anywhere a fair share of all
/// directions then finds the sun.
constexpr double kSoftest = 0.5;

const EnvironmentMap* map_of(const Scene& scene) {
  if (!scene.environment()) return nullptr;
  return std::get_if<EnvironmentMap>(&scene.emitters()[*scene.environment()]);
}

/// A sun of solid angle Omega, blurred to a peak of S Omega / (2 pi sigma^2) = S / 4.
double sharpest_blur(const EnvironmentMap& map) {
  return std::sqrt(2.0 * kInvPi * map.peak_solid_angle());
}

}  // namespace

TemperedScenes::TemperedScenes(const Scene& scene, std::optional<int> levels) : scene_(&scene) {
  const EnvironmentMap* map = map_of(scene);
  if (map == nullptr) return;
  const double sharpest = std::min(sharpest_blur(*map), kSoftest);
  const double halvings = std::log2(kSoftest / sharpest);
  const int count =
      levels.value_or(halvings < 1.0 ? 0 : 1 + static_cast<int>(std::lround(halvings)));
  const EnvironmentMap* below = map;
  double before = 0.0;
  for (int k = 1; k <= count; ++k) {
    const double share = count > 1 ? static_cast<double>(count - k) / (count - 1) : 0.0;
    const double sigma = kSoftest * std::pow(sharpest / kSoftest, share);
    SceneBuilder builder(scene);
    // Variances of successive blurs add up.
    builder.replace_environment(below->blurred(std::sqrt(sigma * sigma - before * before)));
    softer_.push_back(builder.build());
    below = map_of(softer_.back());
    before = sigma;
  }
}

}  // namespace driftlight
