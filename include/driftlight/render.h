// SPDX-License-Identifier: Apache-2.0
/// Rendering: an integrator runs over a scene and returns an image.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "driftlight/gradient_table.h"
#include "driftlight/image.h"
#include "driftlight/options.h"
#include "driftlight/scene.h"

namespace driftlight {

class StepLayers;

/// The image of a render on the way.
struct Snapshot {
  double fraction = 0;  ///< that it was asked for
  double seconds = 0;   ///< of the render so far, without what snapshots took
  double work = 0;      ///< so far: samples per pixel, with Mode::Chain mutations per pixel
  Image image;
};

struct Progress {
  double fraction = 0;  ///< of the work or of the time, in [0, 1]
  double elapsed = 0;   ///< seconds
};

/// What every integrator needs to be told.
struct RenderOptions {
  /// Threads of the machine; 0: all. The image does not depend on it.
  int threads = 0;
  std::uint64_t seed = 0;
  /// Seconds to render, with the bootstrap or the pilot; the image then depends on the machine's
  /// speed. None: by work.
  std::optional<double> time;
  /// Called now and then, from one thread at a time.
  std::function<void(const Progress&)> progress;
  /// Fractions of the time or of the work in (0, 1], rising, at which `snapshot` receives the image
  /// so far: at the first pass or round that ends there or later, and only once where that passes
  /// several of them. Time spent on it does not count. The image does not depend on it, but for
  /// rounding with Mode::Chain.
  std::vector<double> snapshot_at;
  std::function<void(Snapshot)> snapshot;
  /// When it turns true the render ends early and returns what it has.
  const std::atomic<bool>* stop = nullptr;
  /// Where the Langevin sampler records its small steps, if not null. The image does not depend on
  /// it, nor on its size.
  StepLayers* layers = nullptr;
  /// Checks the derivatives that the Langevin sampler uses at a random sample of its states
  /// (gradient_probe.h). The image does not depend on it.
  bool check_gradients = false;
  /// Receives from bidirectional path tracing what each strategy adds to the image, weighted, if
  /// not null: their sum is the image. Channels sStT.R, sStT.G, sStT.B with S vertices from the
  /// light and T from the sensor, for all max_depth (max_depth + 3) / 2 - 1 strategies; rendering
  /// them takes 24 bytes a strategy and pixel.
  Layers* strategies = nullptr;
  /// Receives from the Langevin sampler, but for Mode::Chain, who carries what of the image, if not
  /// null: channels samples, chains and particles, each with .R, .G, .B, whose sum is the image;
  /// and families, the effective number of families of particles that the tile of 16 x 16 pixels
  /// about it rests on.
  Layers* shares = nullptr;
};

/// Why proposals of the small step were rejected.
struct Rejections {
  std::uint64_t missed = 0;
  std::uint64_t other_lobe = 0;
  std::uint64_t occluded = 0;
  std::uint64_t non_finite = 0;
  std::uint64_t hastings = 0;

  Rejections& operator+=(const Rejections& other);
};

struct KernelStatistics {
  std::uint64_t proposed = 0;
  double accepted = 0;  ///< sum of acceptance probabilities

  double acceptance() const { return proposed > 0 ? accepted / static_cast<double>(proposed) : 0; }
  KernelStatistics& operator+=(const KernelStatistics& other);
};

/// Of Mode::Splitting, at one level of softness.
struct LevelFigures {
  std::uint64_t particles = 0;  ///< that came to it
  std::uint64_t died = 0;       ///< that went no further
  /// Sums of r = (target of the next level) / (target of this one) and of r^2, over particles.
  double ratio = 0;
  double squared_ratio = 0;
  KernelStatistics steps;
  KernelStatistics second_steps;  ///< those that follow a rejected one
  Rejections rejections;

  LevelFigures& operator+=(const LevelFigures& other);
};

struct LangevinStatistics {
  KernelStatistics large_step;
  KernelStatistics small_step;
  KernelStatistics second_step;       ///< those that follow a rejected small one
  double large_step_probability = 0;  ///< that was used
  Rejections rejections;
  /// Mutations spent at paths of n edges.
  std::array<std::uint64_t, kMaxPathLength + 1> path_length{};
  std::uint64_t mutations = 0;
  /// Normalization: mean luminance of the image by the chains; in Mode::Redistribution of it all.
  double b = 0;
  double b_error = 0;  ///< its standard error; in Mode::Redistribution it is not known
  /// Of paths of one and two edges, if they are rendered apart.
  double direct_mean = 0;  ///< mean luminance
  double direct_samples_per_pixel = 0;
  double direct_seconds = 0;  ///< part of render_seconds
  /// Of Mode::Redistribution: mean luminance that chains carry, and how many samples started any.
  double remainder = 0;
  std::uint64_t starts = 0;
  double threshold = 0;             ///< tau
  double perturbations = 0;         ///< share of the mutations
  double mutations_per_sample = 0;  ///< most, in the mean
  double light_subpaths = 1;        ///< for each sample, in the mean
  double samples_per_pixel = 0;
  /// Of Mode::Splitting: from level 0, the scene itself, to the softest; empty if nothing was left
  /// to splitting.
  std::vector<LevelFigures> levels;
  double split = 0;                 ///< mean luminance that particles carry
  double split_deposit = 0;         ///< weight of a particle, in units of the brightness about
  double split_rate = 0;            ///< samples of the softest level for each of the scene
  std::size_t split_sequences = 0;  ///< lobe sequences that are left to them
  /// (sum F)^2 / (sum F^2) over families, F what all particles of one sample bring.
  double effective_families = 0;
  /// Part of `split` in tiles of 16 x 16 pixels that rest on fewer than 16 effective families, and
  /// so have a standard error of more than a fourth.
  double split_of_few_families = 0;
  double bootstrap_seconds = 0;
  double render_seconds = 0;
  bool stopped = false;

  LangevinStatistics& operator+=(const LangevinStatistics& other);
};

struct LangevinResult {
  Image image;
  LangevinStatistics statistics;
  std::optional<GradientTable> gradient_check;  ///< if it was asked for
};

/// Renders with the Langevin sampler ([E63]; large steps and normalization as DESIGN 1.8).
/// `work` is the work if no time is given: mutations per pixel, in Mode::Redistribution samples per
/// pixel, at least one.
/// Throws OptionError, and InputError if no path of the scene carries light to the sensor.
LangevinResult render_langevin(const Scene& scene, const LangevinOptions& options,
                               const RenderOptions& render, double work);

/// Renders with primary sample space Metropolis light transport (Kelemen, Szirmay-Kalos, Antal and
/// Csonka 2002): chains of the random numbers of bidirectional path tracing, all of whose
/// strategies a mutation tries. Statistics as of Mode::Chain. Throws as render_langevin.
LangevinResult render_pssmlt(const Scene& scene, const PssmltOptions& options,
                             const RenderOptions& render, double mutations_per_pixel);

/// Renders with multiplexed Metropolis light transport (Hachisuka, Kaplanyan and Dachsbacher 2014):
/// chains of the random numbers of one strategy. MmltOptions::large_steps says how it changes.
/// Statistics as of Mode::Chain. Throws as render_langevin.
LangevinResult render_mmlt(const Scene& scene, const MmltOptions& options,
                           const RenderOptions& render, double mutations_per_pixel);

/// Renders with Hessian-Hamiltonian Monte Carlo (Li, Lehtinen, Ramamoorthi, Jakob and Durand 2015,
/// "Anisotropic Gaussian mutations for Metropolis light transport through Hessian-Hamiltonian
/// dynamics"): chains as of MMLT, whose small steps follow the gradient and the Hessian of the
/// target. Statistics as of Mode::Chain. Throws as render_langevin.
LangevinResult render_h2mc(const Scene& scene, const H2mcOptions& options,
                           const RenderOptions& render, double mutations_per_pixel);

/// Renders with Langevin Monte Carlo (Luan, Zhao, Bala and Gkioulekas 2020, "Langevin Monte Carlo
/// rendering with gradient-based adaptation"), online or with a cache: chains as of MMLT, whose
/// small steps follow the gradient, scaled in each coordinate by former ones. Statistics as of
/// Mode::Chain. Throws as render_langevin.
LangevinResult render_lmc(const Scene& scene, const LmcOptions& options,
                          const RenderOptions& render, double mutations_per_pixel);

/// Renders with the Langevin step of [E63] in primary sample space: chains as of MMLT, whose small
/// steps have the drift of the gradient and the matrix of the constraints, both by the numbers of a
/// path. There sampling has done away with the constraints of lobes and lights that a number draws
/// from; those of the vertices that a strategy connects remain. Statistics as of Mode::Chain.
/// Throws as render_langevin.
LangevinResult render_mala(const Scene& scene, const MalaOptions& options,
                           const RenderOptions& render, double mutations_per_pixel);

/// Renders with Metropolis light transport (Veach and Guibas 1997, "Metropolis light transport";
/// Veach 1997, ch. 11): chains of paths by their vertices, with bidirectional mutations, lens,
/// caustic and multi-chain perturbations, and manifold perturbations (Jakob and Marschner 2012,
/// "Manifold exploration"). Statistics as of Mode::Chain, the bidirectional mutations
/// as large steps and the perturbations as small ones. Throws as render_langevin.
LangevinResult render_mlt(const Scene& scene, const MltOptions& options,
                          const RenderOptions& render, double mutations_per_pixel);

/// Renders with energy redistribution path tracing (Cline, Talbot and Egbert 2005, "Energy
/// redistribution path tracing"), from bidirectional samples: a path that one of them finds starts
/// as many chains of perturbations, as of render_mlt, as its light pays for, since each mutation
/// deposits the same. Unbiased, without normalization. `samples_per_pixel` is the work if no time
/// is given. Statistics as of Mode::Redistribution. Throws as render_langevin.
LangevinResult render_erpt(const Scene& scene, const ErptOptions& options,
                           const RenderOptions& render, int samples_per_pixel);

/// Of an integrator whose samples are independent.
struct PathResult {
  Image image;
  double samples_per_pixel = 0;
  double render_seconds = 0;
  std::uint64_t non_finite = 0;  ///< samples that were NaN or infinite, counted as no light
  bool stopped = false;
};

/// Renders with a path tracer: next-event estimation and BSDF sampling, combined with the balance
/// heuristic (Veach 1997). `samples_per_pixel` is the work if no time is given.
PathResult render_path(const Scene& scene, const PathOptions& options, const RenderOptions& render,
                       int samples_per_pixel);

/// Renders with bidirectional path tracing (Lafortune and Willems 1993; Veach 1997, ch. 10): for
/// each sample a subpath from the sensor, one from the light, and all connections between them and
/// to freshly drawn emitter points. `samples_per_pixel` is the work if no time is given.
PathResult render_bdpt(const Scene& scene, const BdptOptions& options, const RenderOptions& render,
                       int samples_per_pixel);

/// Renders with light tracing (Arvo 1986; Dutre, Lafortune and Willems 1993): subpaths from the
/// light, as many as pixels in each sample, whose vertices connect to the sensor; emitters that
/// are seen directly come from camera rays. Light that the sensor sees by way of a smooth mirror or
/// smooth glass cannot be found and is missing.
PathResult render_light(const Scene& scene, const LightOptions& options,
                        const RenderOptions& render, int samples_per_pixel);

}  // namespace driftlight
