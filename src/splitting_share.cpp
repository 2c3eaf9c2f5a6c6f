// SPDX-License-Identifier: Apache-2.0
#include "splitting_share.h"

#include <algorithm>
#include <cmath>

#include "splitting_pilot.h"

namespace driftlight {
namespace {

/// A tile that rests on fewer families has a standard error of more than a fourth.
constexpr double kFewFamilies = 16.0;

}  // namespace

SplittingShare::SplittingShare(const Scene& scene, const LangevinOptions& options,
                               const RenderOptions& render, const Remainder& remainder,
                               BrightnessMap& brightness)
    : options_(options),
      remainder_(remainder),
      brightness_(brightness),
      layers_(render.layers),
      levels_(scene, options.mode == Mode::Splitting ? options.splitting.levels : std::optional(0)),
      top_guide_(levels_[levels_.top()]),
      film_(scene.camera().film_width, scene.camera().film_height, scene.camera().filter),
      tiles_(scene.camera().film_width, scene.camera().film_height) {
  if (levels_.top() > 0)
    plan_ = plan_splitting(levels_, splitter(), options, render.seed, brightness);
  unit_ = brightness.film_unit();
}

void SplittingShare::Sampler::sample(const Vec2d& film, Rng& rng) {
  if (!share_.plan_.some) return;
  const double rate = share_.plan_.rate;
  const double samples = std::floor(rate + rng.uniform());
  for (double i = 0; i < samples; ++i) sample_once(film, 1.0 / rate, rng);
}

void SplittingShare::Sampler::sample_once(const Vec2d& film, double weight, Rng& rng) {
  double family = 0.0;
  tiles_.clear();
  splitter_.sample(film, share_.plan_, rng,
                   [&](LobeSequence, int, const Share& at, const Rgbd& color, double visit) {
                     const double amount = weight * visit;
                     family += visit;
                     tiles_[share_.tiles_.at(at.film)] += visit;
                     share_.film_.splat(at.film, color, amount * at.brightness / share_.unit_);
                   });
  share_.count(family, tiles_, splitter_.take_figures());
}

void SplittingShare::count(double family, const std::map<int, double>& by_tile,
                           const std::vector<LevelFigures>& figures) {
  families_.add(family / plan_.deposit);
  squared_families_.add(family * family / (plan_.deposit * plan_.deposit));
  for (const auto& [tile, sum] : by_tile) tiles_.add(tile, sum / plan_.deposit);
  const std::lock_guard lock(mutex_);
  figures_.resize(std::max(figures_.size(), figures.size()));
  for (std::size_t k = 0; k < figures.size(); ++k) figures_[k] += figures[k];
}

Image SplittingShare::image(double passes) const {
  return film_.develop(unit_ / std::max(1.0, passes));
}

void SplittingShare::report(const Image& image, LangevinStatistics& statistics) const {
  for (const LevelFigures& level : figures_) {
    statistics.small_step += level.steps;
    statistics.second_step += level.second_steps;
    statistics.rejections += level.rejections;
  }
  statistics.levels = figures_;
  statistics.split = mean_luminance(image);
  if (!plan_.some) return;
  statistics.split_deposit = plan_.deposit;
  statistics.split_rate = plan_.rate;
  statistics.split_sequences = plan_.taken.size();
  const double sum = families_.value();
  if (sum > 0.0) statistics.effective_families = sum * sum / squared_families_.value();
  statistics.split_of_few_families = tiles_.luminance_of_fewer(kFewFamilies, image);
}

}  // namespace driftlight
