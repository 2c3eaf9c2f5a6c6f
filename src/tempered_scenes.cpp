// SPDX-License-Identifier: Apache-2.0
#include "tempered_scenes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "driftlight/phase_space.h"
#include "driftlight/walk.h"
#include "softened_bsdf.h"

namespace driftlight {
namespace {

/// Standard deviations of the softest level, radians: from anywhere a fair share of all directions
/// then finds the sun; and lamps not by rays that turn their backs to them.
constexpr double kSoftestSun = 0.5;
constexpr double kSoftestLamp = 0.3;
/// Lamps that are wider than this are found without help.
constexpr double kSmallLamp = 0.05;
/// Least roughness of what has narrow lobes at the softest level: connections then find the way
/// through glossy lobes.
constexpr double kSoftestLobe = 0.3;
/// Chains find their way through lobes that are wider than this: in glass_block they do as well.
constexpr double kNarrowLobe = 0.01;

/// Width at level k > 0 of `top`: from `sharpest` to `softest`.
double width_at(int k, int top, double sharpest, double softest) {
  const double share = top > 1 ? static_cast<double>(top - k) / (top - 1) : 0.0;
  return softest * std::pow(std::min(sharpest, softest) / softest, share);
}

/// Width of an emitter at a level, over that at the next sharper one.
constexpr double kHalving = 2.0;
/// The same of a lobe. In the middle of n lobes a path is 4^n times as bright if they are halved,
/// and its particles multiply faster than they find their way out; so it is 2^n times.
constexpr double kLobeStep = std::numbers::sqrt2;

/// Levels of widths that differ by so much; 0 where there is no need.
int levels_between(double sharpest, double softest, double step) {
  const double steps = std::log(softest / sharpest) / std::log(step);
  return steps < 1.0 ? 0 : 1 + static_cast<int>(std::lround(steps));
}

/// A sun of solid angle Omega, blurred to a peak of S Omega / (2 pi sigma^2) = S / 4.
double sharpest_blur(const EnvironmentMap& map) {
  return std::sqrt(2.0 * kInvPi * map.peak_solid_angle());
}

// ---- Lamps ----------------------------------------------------------------------------------

struct Farthest {
  double distance = 0;  ///< from the centroid
  double spread = 0;    ///< |W (p - centroid)|^2
};

Farthest farthest(const Shape& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape.geometry)) return {sphere->radius, 3.0};
  if (const auto* disk = std::get_if<Disk>(&shape.geometry))
    return {std::sqrt(disk->u.squaredNorm() + disk->v.squaredNorm()), 4.0};
  if (const auto* cylinder = std::get_if<Cylinder>(&shape.geometry))
    return {std::hypot(cylinder->radius, 0.5 * cylinder->length), 5.0};
  Farthest most;
  for (const auto& p : std::get<TriangleMesh>(shape.geometry).positions) {
    const Vec3d offset = p.cast<double>() - shape.extent.centroid;
    most.distance = std::max(most.distance, offset.norm());
    most.spread = std::max(most.spread, (shape.extent.whitening * offset).squaredNorm());
  }
  return most;
}

/// None for a lamp that is but a line.
std::optional<LampExtent> lamp_extent(const Shape& shape) {
  const Farthest most = farthest(shape);
  LampExtent lamp{.center = shape.extent.centroid, .spread = most.spread, .reach = most.distance};
  int flat = -1;
  for (int i = 0; i < 3; ++i) {
    const Vec3d row = shape.extent.whitening.row(i);
    if (row.isZero(0.0)) {
      if (flat >= 0) return std::nullopt;
      flat = i;
    } else {
      lamp.axes.row(i) = row.normalized();
      lamp.variance[i] = 1.0 / row.squaredNorm();
    }
  }
  if (flat >= 0) {
    const Vec3d a = lamp.axes.row((flat + 1) % 3);
    const Vec3d b = lamp.axes.row((flat + 2) % 3);
    lamp.axes.row(flat) = a.cross(b);
    lamp.normal = emitter_normal(shape, lamp.center);
  }
  return lamp;
}

/// Angle under which the lamp's thinner side shows: from the sensor, or from the far side of the
/// scene if that is nearer or the sensor is orthographic.
double angular_size(const LampExtent& lamp, const Scene& scene) {
  double least = lamp.variance.maxCoeff();
  for (const double variance : lamp.variance)
    if (variance > 0.0) least = std::min(least, variance);
  double distance = scene.radius();
  const Camera& camera = scene.camera();
  if (!camera.is_orthographic())
    distance = std::min(distance, (camera.origin - lamp.center).norm());
  return std::sqrt(least) / distance;
}

// ---- What is softened -----------------------------------------------------------------------

/// What is too small to be found.
struct Sharp {
  const EnvironmentMap* sun = nullptr;
  struct Lamp {
    std::uint32_t emitter;
    LampExtent extent;
    double size;
  };
  std::vector<Lamp> lamps;
  double roughness = kInfinity;  ///< of the narrowest lobe; infinite if none is narrow

  explicit Sharp(const Scene& scene) {
    for (std::uint32_t i = 0; i < scene.emitters().size(); ++i) {
      const Emitter& emitter = scene.emitters()[i];
      if (const auto* map = std::get_if<EnvironmentMap>(&emitter)) sun = map;
      const auto* area = std::get_if<AreaEmitter>(&emitter);
      const auto lamp = area != nullptr ? lamp_extent(scene.shapes()[area->shape]) : std::nullopt;
      if (lamp) lamps.push_back({i, *lamp, angular_size(*lamp, scene)});
    }
    for (const Bsdf& bsdf : scene.bsdfs()) roughness = std::min(roughness, least_roughness(bsdf));
    if (roughness >= kNarrowLobe) roughness = kInfinity;
  }

  bool has_small_lamp() const {
    return std::any_of(lamps.begin(), lamps.end(),
                       [](const Lamp& lamp) { return lamp.size < kSmallLamp; });
  }

  /// Width of the first level's sun; and least roughness of its narrow lobes.
  double first_blur() const { return sharpest_blur(*sun); }
  double first_roughness() const { return kLobeStep * roughness; }

  /// As many as the sharpest part needs.
  int levels() const {
    int count = sun != nullptr ? levels_between(first_blur(), kSoftestSun, kHalving) : 0;
    for (const Lamp& lamp : lamps)
      count = std::max(count, levels_between(lamp.size, kSoftestLamp, kHalving));
    return std::max(count, levels_between(first_roughness(), kSoftestLobe, kLobeStep));
  }
};

/// Those with narrow lobes at level k.
std::vector<Bsdf> softer_bsdfs(const Scene& scene, const Sharp& sharp, int k, int top) {
  std::vector<Bsdf> bsdfs(scene.bsdfs().begin(), scene.bsdfs().end());
  const double least = width_at(k, top, sharp.first_roughness(), kSoftestLobe);
  for (Bsdf& bsdf : bsdfs)
    if (least_roughness(bsdf) < kNarrowLobe) bsdf = softened(std::move(bsdf), least);
  return bsdfs;
}

/// Each softer than that of the scene below.
std::vector<Emitter> softer_emitters(const Scene& scene, const Scene& below, const Sharp& sharp,
                                     int k, int top) {
  std::vector<Emitter> emitters(below.emitters().begin(), below.emitters().end());
  for (const Sharp::Lamp& lamp : sharp.lamps)
    emitters[lamp.emitter] =
        BlurredAreaEmitter(std::get<AreaEmitter>(scene.emitters()[lamp.emitter]), lamp.extent,
                           width_at(k, top, lamp.size, kSoftestLamp));
  if (sharp.sun != nullptr) {
    const double sigma = width_at(k, top, sharp.first_blur(), kSoftestSun);
    const double before = k > 1 ? width_at(k - 1, top, sharp.first_blur(), kSoftestSun) : 0.0;
    // Variances of successive blurs add up.
    Emitter& sun = emitters[*scene.environment()];
    sun = std::get<EnvironmentMap>(sun).blurred(std::sqrt(sigma * sigma - before * before));
  }
  return emitters;
}

}  // namespace

TemperedScenes::TemperedScenes(const Scene& scene, std::optional<int> levels) : scene_(&scene) {
  Sharp sharp(scene);
  if (!levels && !sharp.has_small_lamp()) sharp.lamps.clear();
  if (sharp.sun == nullptr && sharp.lamps.empty() && sharp.roughness == kInfinity) return;
  const int top = levels.value_or(sharp.levels());
  blurs_lamps_ = top > 0 && !sharp.lamps.empty();
  softens_lobes_ = top > 0 && sharp.roughness < kInfinity;
  for (int k = 1; k <= top; ++k) {
    Scene softer = scene.with_emitters(softer_emitters(scene, (*this)[k - 1], sharp, k, top));
    if (softens_lobes_) softer = softer.with_bsdfs(softer_bsdfs(scene, sharp, k, top));
    softer_.push_back(std::make_unique<const Scene>(std::move(softer)));
  }
}

/// Another lamp's paths are its own: it is blurred too.
std::optional<PathTopology> TemperedScenes::at_level_0(const PathTopology& path,
                                                       const PathCoordinates& coordinates) const {
  if (!blurs_lamps_ || path.end != PathEnd::Hit) return path;
  PathTopology result;
  const bool reached = trace(*scene_, path, coordinates, result) == TraceStatus::Ok;
  if (!reached || result.emitter != path.emitter) return std::nullopt;
  return result;
}

}  // namespace driftlight
