// SPDX-License-Identifier: Apache-2.0
#include "emission_guide.h"

#include <cmath>

namespace driftlight {
namespace {

/// Share of the subpaths that are drawn without guidance, so that none is ever much rarer.
constexpr double kUnguided = 0.2;

}  // namespace

EmissionGuide::EmissionGuide(const Scene& scene) : scene_(&scene) {}

/// Under emission alone an estimate c that was drawn with the factor g would have been c g, with
/// probability 1 / g: its second moment is c^2 g.
EmissionGuide::EmissionGuide(const Scene& scene, const std::vector<Record>& records)
    : scene_(&scene) {
  const std::size_t count = scene.emitters().size();
  std::vector<std::vector<CubeRecord>> by_emitter(count);
  for (const Record& r : records) {
    const double moment = r.value * r.value * r.factor;
    if (!(moment > 0.0) || !std::isfinite(moment)) continue;
    CubeRecord& record = by_emitter[r.emitter].emplace_back();
    for (std::size_t a = 0; a < record.at.size(); ++a)
      record.at[a] = static_cast<float>(r.sample[a]);
    record.moment = static_cast<float>(moment);
  }
  std::vector<double> shares;
  double total = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    DensityTree tree(by_emitter[i], invertible_axes(scene, i), kUnguided);
    shares.push_back(tree.mass() * std::sqrt(scene.emitter_probability(i)));
    total += shares.back();
    emitters_.push_back({std::move(tree), 1.0});
  }
  if (!(total > 0.0)) {
    emitters_.clear();
    return;
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const double p = scene.emitter_probability(i);
    shares[i] = kUnguided * p + (1.0 - kUnguided) * shares[i] / total;
    if (p > 0.0) emitters_[i].choice = shares[i] / p;
  }
  choice_.emplace(shares);
}

EmissionGuide EmissionGuide::at_rate(double rate) const {
  EmissionGuide result = *this;
  result.rate_ = rate;
  return result;
}

Emission EmissionGuide::sample(Rng& rng) const {
  double u = rng.uniform();
  const Vec2d first = rng.uniform2();
  const Vec2d last = rng.uniform2();
  const EmissionSample even{first.x(), first.y(), last.x(), last.y()};
  if (!choice_) return emit(*scene_, scene_->sample_emitter(u), even);
  const auto emitter = static_cast<std::uint32_t>(choice_->sample(u));
  return emit(*scene_, emitter, emitters_[emitter].tree.sample(even));
}

double EmissionGuide::factor(std::uint32_t emitter, const Vec3d& p, const Vec3d& v) const {
  if (!choice_) return rate_;
  const Learned& learned = emitters_[emitter];
  if (learned.tree.is_uniform()) return rate_ * learned.choice;
  return rate_ * learned.choice * learned.tree.density(emission_sample(*scene_, emitter, p, v));
}

}  // namespace driftlight
