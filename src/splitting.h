// SPDX-License-Identifier: Apache-2.0
/// Tempered splitting (DESIGN 1.10): particles that carry light from soft levels down to the scene.
///
/// With f_k the contribution at level k (tempered_scenes.h) and m the guess of the brightness at a
/// path's film point, the target of level k > 0 is pi_k = f_k / m and that of level 0 the remainder
/// pi_0 = (f - tau m q)_+ / m (remainder.h). A bidirectional sample of the top level K finds paths
/// with weights w = pi_K / q_K; each starts particles of weight e, w / e in the mean. At each level
/// a particle makes steps that leave pi_k invariant, then goes on as floor(r + u) copies,
/// r = pi_(k-1) / pi_k. In expectation particles of weight e are distributed as pi_k at every
/// level, so those of level 0 are the remainder: unbiased whatever the levels, steps and e, since
/// pi_(k-1) > 0 implies pi_k > 0. A ratio too large for copies multiplies the weight instead.
///
/// Of the multilevel splitting of rare events (Kahn and Harris 1951; Cerou and Guyader 2007).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "bidirectional_tracer.h"
#include "found_path.h"
#include "lobe_sequence.h"
#include "remainder.h"
#include "tempered_scenes.h"

namespace driftlight {

/// Which paths are left to splitting, and in which portions.
struct SplittingPlan {
  bool some = false;                     ///< else none
  bool unseen = true;                    ///< also those that the pilot has not seen, if some are
  std::vector<LobeSequence> taken = {};  ///< in order: of those that it has seen
  std::vector<LobeSequence> left = {};   ///< in order: the others that it has seen
  double deposit = 1;                    ///< e
  double rate = 1;                       ///< samples of the top level for each of the scene

  bool takes(LobeSequence sequence) const;
};

/// Runs the particles of one sample after the other. A copy shares nothing but references.
class Splitter {
 public:
  /// A visit to level 0, `amount` in units of the brightness m, by a descendant of a particle of
  /// this number among those that the sample has started.
  using Visit = std::function<void(LobeSequence, int particle, const Share&, const Rgbd& color,
                                   double amount)>;

  /// All references must outlive it, `layers` too unless it is null.
  Splitter(const TemperedScenes& scenes, const EmissionGuide& top_guide,
           const LangevinOptions& options, const Remainder& remainder,
           const BrightnessMap& brightness, StepLayers* layers);
  Splitter(const Splitter& other);
  ~Splitter();

  /// One bidirectional sample of the top level and the particles that start from it.
  void sample(const Vec2d& film, const SplittingPlan& plan, Rng& rng, const Visit& visit);

  /// By level, since they were last taken.
  std::vector<LevelFigures> take_figures();

 private:
  struct Level;
  struct Particles;

  const TemperedScenes& scenes_;
  const LangevinOptions& options_;
  const Remainder& remainder_;
  const BrightnessMap& brightness_;
  StepLayers* layers_;
  BidirectionalTracer tracer_;
  std::unique_ptr<Particles> particles_;  ///< none before the first one
};

}  // namespace driftlight
