// SPDX-License-Identifier: Apache-2.0
/// What redistribution (DESIGN 1.9) leaves to chains.
///
/// With q = sum_s q_s the density of the paths that one bidirectional sample finds, m the guess of
/// the brightness at a path's film point and w = f / (q m),
///   f = m q min(w, tau) + m q (w - tau)_+.
/// Strategy s of n finds the path with the value c_s f / q, c_s = w_s q / q_s with weights w_s that
/// add up to 1, so that sum_s q_s c_s = q: c_s min(w, tau) m is what the sample puts on the film,
/// and c_s (w - tau)_+ starts chains, right in the mean by any weights. Those of the power
/// heuristic have less noise than those of the balance heuristic, by which c_s = 1, where few
/// strategies find most, hardly more elsewhere, and c_s is at most (1 + sqrt n) / 2. Samples carry
/// the first part; their values are bounded by c_s tau in units of m. The chains target the
/// remainder over m, pi = q (w - tau)_+, and deposit m times what they visit. Any m > 0 is right;
/// this one spreads the work, and the noise, over the image in proportion to its brightness.
///
/// Emitters that are seen directly have a higher tau. Samples find a large one with the same weight
/// all over, and to spread that would only add noise. The edge of a tiny one, far brighter than
/// what is around it, is still left to chains.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "brightness_map.h"
#include "driftlight/small_step.h"
#include "emission_guide.h"
#include "found_path.h"
#include "mutation_loop.h"
#include "vertex_path.h"

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
  /// q is of samples by this guide. With a ceiling in the place of infinity it is what of
  /// (w - tau)_+ lies below that, (min(w, ceiling) - tau)_+. All references must outlive it.
  Remainder(const Scene& scene, const EmissionGuide& guide, const BrightnessMap& brightness,
            double tau, double ceiling = kInfinity)
      : scene_(scene), guide_(guide), brightness_(brightness), tau_(tau), ceiling_(ceiling) {}

  /// What lies below and what above the height h, whose sum it is.
  std::array<Remainder, 2> split_at(double h) const {
    return {Remainder{scene_, guide_, brightness_, tau_, h},
            Remainder{scene_, guide_, brightness_, h, ceiling_}};
  }

  /// The least tau.
  double tau() const { return tau_; }
  void set_tau(double tau) { tau_ = tau; }
  /// That of paths of so many edges.
  double tau(int edges) const { return edges > 1 ? tau_ : tau_seen(tau_); }
  double ceiling(int edges) const { return edges > 1 ? ceiling_ : tau_seen(ceiling_); }
  /// Of paths of one edge, where that of others is tau.
  static double tau_seen(double tau) { return 16.0 * std::max(1.0, tau); }
  /// w of what a sample has found at the film point.
  double weight(const Vec2d& film, const Rgbd& value, const FoundPath& path) const {
    return luminance(value) / (path.factor * brightness_(film));
  }
  /// What samples leave of a path of that weight, times its factor: 0 where they carry it whole,
  /// as they do what is so bright that sums might overflow.
  double left(double weight, const FoundPath& path) const;
  /// The path with coordinates of the phase space; none if it has none there, or if by rounding
  /// nothing of it remains.
  std::optional<BrightPath> bright_path(const FoundPath& path, PhaseSpace phase_space) const;
  std::optional<BrightPath> bright_path(const VertexPath& path, PhaseSpace phase_space) const;
  /// Of a path with light. One that is too bright, or whose density is not finite, has no
  /// remainder.
  Share share(const PathTopology& topology, const PathCoordinates& coordinates,
              const Contribution& contribution) const;
  /// The same of an evaluated path in the measure of vertex_path.h.
  Share share(const VertexPath& path) const;

 private:
  Share share(int edges, const Contribution& contribution, double log_q) const;
  std::optional<BrightPath> bright_path(const std::optional<PathSampler::Sample>& path) const;

  const Scene& scene_;
  const EmissionGuide& guide_;
  const BrightnessMap& brightness_;
  double tau_;
  double ceiling_;
};

/// A chain that leaves the remainder invariant, by Langevin steps.
class RemainderChain {
 public:
  /// Steps are recorded in `layers` unless it is null. The kernel must outlive it.
  RemainderChain(const Scene& scene, const KernelOptions& kernel,
                 const DelayedRejection& delayed_rejection, const Remainder& remainder,
                 StepLayers* layers)
      : remainder_(remainder),
        small_step_(scene, kernel, delayed_rejection.scale()),
        layers_(layers) {}

  void start_at(const BrightPath& path);
  BrightPath current() const {
    return {current_.state.topology, current_.state.coordinates, current_.state.contribution,
            current_.share};
  }

  /// Shows the probe, unless it is null, each state whose step is prepared from now on.
  void observe(GradientProbe* probe) { small_step_.observe(probe); }

  /// Reports visits to splat(share, color, weight): after each mutation both states, with weights
  /// that add up to 1. Returns whether it has moved.
  template <class Splat>
  bool run(std::uint64_t mutations, Rng& rng, const Splat& splat);
  /// Reports what as many mutations would that all fail.
  template <class Splat>
  void stay(std::uint64_t mutations, const Splat& splat) const {
    splat(current_.share, current_.state.contribution.color, static_cast<double>(mutations));
  }

  /// Since they were last taken.
  ChainFigures take_statistics() { return std::exchange(figures_, {}); }

 private:
  struct Visit {
    ChainState state;
    Share share;
  };

  /// As run_mutations has it.
  double propose(Visit& from, Visit& to, MutationStage stage, Rng& rng, Rejections& rejections);

  const Remainder& remainder_;
  SmallStep small_step_;
  StepLayers* layers_;
  Visit current_;
  std::array<Visit, 3> visits_;
  ChainFigures figures_;
};

template <class Splat>
bool RemainderChain::run(std::uint64_t mutations, Rng& rng, const Splat& splat) {
  const auto propose = [&](Visit& from, Visit& to, MutationStage stage, Rng& numbers,
                           Rejections& rejections) {
    const double ratio = this->propose(from, to, stage, numbers, rejections);
    if (layers_ != nullptr && stage == MutationStage::First)
      small_step_.record(from.state, std::min(1.0, ratio), *layers_);
    return ratio;
  };
  Visit& last = run_mutations(current_, visits_, {mutations, small_step_.delays_rejection()}, rng,
                              figures_, propose, [&](const Visit& at, double weight) {
                                splat(at.share, at.state.contribution.color, weight);
                              });
  if (&last == &current_) return false;
  std::swap(current_, last);
  return true;
}

}  // namespace driftlight
