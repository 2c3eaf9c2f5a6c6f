// SPDX-License-Identifier: Apache-2.0
/// What redistribution (DESIGN 1.9) leaves to chains.
///
/// With q = sum_s q_s the density of the paths that one bidirectional sample finds, m the guess of
/// the brightness at a path's film point and w = f / (q m),
///   f = m q min(w, tau) + m q (w - tau)_+.
/// Samples carry the first part; their weights are bounded by tau in units of m. The chains target
/// the remainder over m, pi = q (w - tau)_+, and deposit m times what they visit. Any m > 0 is
/// right; this one spreads the work, and the noise, over the image in proportion to its brightness.
///
/// Emitters that are seen directly have a higher tau. Samples find a large one with the same weight
/// all over, and to spread that would only add noise. The edge of a tiny one, far brighter than
/// what is around it, is still left to chains.
#pragma once

#include <algorithm>
#include <optional>
#include <utility>

#include "brightness_map.h"
#include "driftlight/small_step.h"
#include "emission_guide.h"
#include "found_path.h"

namespace driftlight {

/// How a path is shared.
struct Share {
  double w = 0;                ///< f / (q m)
  double tau = 0;              ///< for paths of its length
  double log_remainder = 0;    ///< log pi; -infinity where nothing is left
  double brightness = 0;       ///< m
  Vec2d film = Vec2d::Zero();  ///< where the path is seen

  /// (w - tau)_+
  double excess() const { return std::max(0.0, w - tau); }
};

/// A path that samples do not carry whole: chains start from it.
struct BrightPath {
  PathTopology topology;
  PathCoordinates coordinates;
  Contribution contribution;
  Share share;
};

class Remainder {
 public:
  /// q is of samples by this guide. All references must outlive it.
  Remainder(const Scene& scene, const EmissionGuide& guide, const BrightnessMap& brightness,
            double tau)
      : scene_(scene), guide_(guide), brightness_(brightness), tau_(tau) {}

  /// The least tau.
  double tau() const { return tau_; }
  void set_tau(double tau) { tau_ = tau; }
  /// w of what a sample has found at the film point, `value` with balance weights.
  double weight(const Vec2d& film, const Rgbd& value, const FoundPath& path) const {
    return luminance(value) / (path.roulette * brightness_(film));
  }
  /// The path of that weight, if samples do not carry it whole: it may have no coordinates in the
  /// phase space, or no remainder.
  std::optional<BrightPath> bright_path(double weight, const FoundPath& path,
                                        PhaseSpace phase_space) const;
  /// Of a path with light. A path so bright that sums might overflow, or whose density is not
  /// finite, has no remainder: samples carry it whole.
  Share share(const PathTopology& topology, const PathCoordinates& coordinates,
              const Contribution& contribution) const;

 private:
  const Scene& scene_;
  const EmissionGuide& guide_;
  const BrightnessMap& brightness_;
  double tau_;
};

struct ChainFigures {
  KernelStatistics small_step;
  Rejections rejections;
};

/// Runs short chains that leave the remainder invariant.
class RemainderChain {
 public:
  /// Steps are recorded in `layers` unless it is null.
  RemainderChain(const Scene& scene, const KernelOptions& kernel, const Remainder& remainder,
                 StepLayers* layers)
      : remainder_(remainder), small_step_(scene, kernel), layers_(layers) {}

  /// The path that the next chains start from.
  void start_at(const BrightPath& path);

  /// Shows the probe, unless it is null, each state whose step is prepared from now on.
  void observe(GradientProbe* probe) { small_step_.observe(probe); }

  /// Reports visits to splat(share, color, weight): after each mutation both states, with weights
  /// that add up to 1.
  template <class Splat>
  void run(std::uint64_t mutations, Rng& rng, const Splat& splat);

  /// Since they were last taken.
  ChainFigures take_statistics() { return std::exchange(figures_, {}); }

 private:
  struct Visit {
    ChainState state;
    Share share;
  };

  /// The acceptance probability of a step from `from` to `to`.
  double propose(Visit& from, Visit& to, Rng& rng);

  const Remainder& remainder_;
  SmallStep small_step_;
  StepLayers* layers_;
  Visit start_;
  Visit visits_[2];
  ChainFigures figures_;
};

template <class Splat>
void RemainderChain::run(std::uint64_t mutations, Rng& rng, const Splat& splat) {
  Visit* from = &start_;
  Visit* to = &visits_[0];
  double gathered = 0;
  const auto flush = [&] {
    if (gathered > 0.0) splat(from->share, from->state.contribution.color, gathered);
    gathered = 0.0;
  };
  for (std::uint64_t i = 0; i < mutations; ++i) {
    const double acceptance = propose(*from, *to, rng);
    if (layers_ != nullptr) small_step_.record(from->state, acceptance, *layers_);
    gathered += 1.0 - acceptance;
    if (rng.uniform() < acceptance) {
      flush();
      Visit* const left = from;
      from = to;
      to = left == &start_ ? &visits_[1] : left;
      gathered = acceptance;
    } else if (acceptance > 0.0) {
      splat(to->share, to->state.contribution.color, acceptance);
    }
  }
  flush();
}

}  // namespace driftlight
