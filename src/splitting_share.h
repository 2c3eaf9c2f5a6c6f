// SPDX-License-Identifier: Apache-2.0
/// What particles carry of an image, beside samples and chains.
#pragma once

#include <map>
#include <mutex>

#include "driftlight/film.h"
#include "driftlight/render.h"
#include "exact_sum.h"
#include "family_tiles.h"
#include "splitting.h"

namespace driftlight {

/// The part of a render that tempered splitting has: levels, plan, film, and what is counted.
class SplittingShare {
 public:
  /// Plans it, in Mode::Splitting by a pilot, which may raise the brightness, that of the
  /// remainder; in another mode it has nothing. All references must outlive it.
  SplittingShare(const Scene& scene, const LangevinOptions& options, const RenderOptions& render,
                 const Remainder& remainder, BrightnessMap& brightness);

  /// Whether it has anything.
  bool has_some() const { return plan_.some; }
  /// Whether particles carry what samples leave of such a path.
  bool takes(const FoundPath& path) const {
    if (!plan_.some) return false;
    const auto state = state_of(levels_[0], path, options_.phase_space);
    return state && levels_.carry(state->topology) && plan_.takes(LobeSequence(state->topology));
  }

  /// Runs samples of the softest level. A copy shares nothing but the share.
  class Sampler {
   public:
    explicit Sampler(SplittingShare& share) : share_(share), splitter_(share.splitter()) {}

    /// As many as the plan has for one sample of the scene at these film coordinates.
    void sample(const Vec2d& film, Rng& rng);

   private:
    void sample_once(const Vec2d& film, double weight, Rng& rng);

    SplittingShare& share_;
    Splitter splitter_;
    std::map<int, double> tiles_;  ///< what the family under way has brought to each
  };

  /// After so many samples of the scene at each pixel.
  Image image(double passes) const;
  const FamilyTiles& families() const { return tiles_; }
  /// Adds its steps and rejections, and sets all that is of splitting alone, to the render's
  /// statistics; `image` is its own.
  void report(const Image& image, LangevinStatistics& statistics) const;

 private:
  Splitter splitter() const {
    return {levels_, top_guide_, options_, remainder_, brightness_, layers_};
  }
  /// What the particles of one sample have brought, in units of the brightness about.
  void count(double family, const std::map<int, double>& by_tile,
             const std::vector<LevelFigures>& figures);

  const LangevinOptions& options_;
  const Remainder& remainder_;
  const BrightnessMap& brightness_;
  StepLayers* layers_;
  TemperedScenes levels_;
  EmissionGuide top_guide_;
  SplittingPlan plan_;
  Film film_;  ///< in units of `unit`
  double unit_ = 1;
  ExactSum families_;  ///< in particles
  ExactSum squared_families_;
  FamilyTiles tiles_;
  std::mutex mutex_;
  std::vector<LevelFigures> figures_;
};

}  // namespace driftlight
