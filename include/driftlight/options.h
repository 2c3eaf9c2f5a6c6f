// SPDX-License-Identifier: Apache-2.0
/// Options of the integrators, with their text form for command lines.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "driftlight/path.h"

namespace driftlight {

/// What the drift a of (E63.3) keeps.
enum class Drift {
  None,      ///< Brownian steps only (E63.7)
  Gradient,  ///< - T T* grad U
  Full,      ///< - T T* grad U + div(T T*)
};

/// Where the matrix of a step comes from (precision.h).
enum class PreconditionerKind {
  Identity,     ///< the same step in every direction
  Diagonal,     ///< the diagonal of Q: a step of its own for each coordinate
  Constraints,  ///< Q of the path's constraints (E63.13)
  Hessian,      ///< the curvature of U
};

/// How derivatives of a path are found; the results agree to rounding.
enum class DerivativeMethod {
  Jet,   ///< automatically, from the contribution's one template
  Hand,  ///< by formulas derived by hand
};

/// A small step of the Langevin kernel (E63.3, 8, 9).
struct KernelOptions {
  Drift drift = Drift::Gradient;
  PreconditionerKind preconditioner = PreconditionerKind::Constraints;
  DerivativeMethod derivatives = DerivativeMethod::Hand;
  /// Constraints include the free width about each segment, found by probe rays (aperture.h).
  bool aperture = false;
  /// Of (E63.8): dt |(a, grad U)| <= epsilon.
  double epsilon = 10;
  /// dt is divided by it.
  double safety = 1;
  /// Upper bound of dt; 1/3 is that of (E63.9).
  double time_step_cap = 1.0 / 3.0;
  /// Factor on T. With the identity preconditioner it is the standard deviation of a step, in
  /// radians, at dt = 1/3. The default pair, 0.1 to 1, was at or near the lowest error at equal
  /// time on all scenes tried; scale 1 alone is right where the constraints are tight and all of f.
  double scale = 0.32;
  /// If positive, each step draws its scale log-uniformly over this many decades about `scale`.
  double scale_decades = 1;
  /// Radius of the trust region: (pi trust)^-2 I in the place of the pi^-2 I of (E63.13), in
  /// radians (Levenberg 1944; Marquardt 1963). The residuals of constraints are linear for short
  /// steps only: one that is long where f hardly changes misses the narrow lobes that Q aims it at.
  /// A smaller radius shortens steps there, and leaves those across narrow lobes as they are.
  double trust = 1;
};

/// How large steps find their paths.
enum class LargeSteps {
  Path,  ///< from the sensor: hitting emitters, or connecting to them
  Bdpt,  ///< from both ends, with all connections
};

/// Who renders paths of one and two edges: light seen directly, or after one scattering.
enum class DirectLight {
  Chain,  ///< the chains, with all the rest
  Apart,  ///< a path tracer, in a pass of its own
};

/// Who carries the light to the film.
enum class Mode {
  Chain,           ///< Markov chains, with normalization by independent samples
  Redistribution,  ///< independent samples; chains spread those that are rare and heavy
  Splitting,       ///< that, and particles from softer versions of the scene for what is too rare
};

/// Of Mode::Redistribution.
struct RedistributionOptions {
  /// tau: samples keep so many times the brightness of the image around them. None: from a pilot.
  std::optional<double> threshold = std::nullopt;
  /// Mutations of a chain.
  int chain_length = 100;
  /// Most mutations for each bidirectional sample, in the mean. None: from a pilot.
  std::optional<double> mutations_per_sample = std::nullopt;
  /// Share of the mutations of chains that are perturbations (Veach and Guibas 1997; Jakob and
  /// Marschner 2012) and not Langevin steps, in turns; 0 unless the sensor is a pinhole. None:
  /// half, or all where a pilot finds that better.
  std::optional<double> perturbations = std::nullopt;
  /// Light subpaths start where a pilot has found that light comes from.
  bool guide = true;
  /// Samples of the last round of the pilot, of about twice as many in all.
  int pilot = 65536;
  /// Light subpaths for each sample, in the mean. None: as many as a pilot finds worth their time.
  std::optional<double> light_subpaths = std::nullopt;
};

/// Of Mode::Splitting, whose samples and chains are those of Mode::Redistribution.
struct SplittingOptions {
  /// Particles carry all of the remainder, not only that for which a pilot finds them worth it.
  bool all = false;
  /// Softer levels above the scene; none: as the scene needs.
  std::optional<int> levels;
  /// Steps of a particle at each level; none: 4, or 16 where narrow lobes are softened, in which a
  /// particle has to find its way.
  std::optional<int> steps;
  /// KernelOptions::scale of those steps over that of the others. They are not to find a target but
  /// to cross it: the lobe of a blurred emitter, which at the next level is half as wide.
  double scale = 3;
  /// KernelOptions::trust of all steps of particles. A family that cannot move in a lobe grows or
  /// dies as a whole from level to level; to move across lobes matters more than far over the film.
  double trust = 0.05;
  /// Steps at the last one, whose visits make the image.
  int last_steps = 32;
  /// Share of these that are perturbations (Veach and Guibas 1997), manifold perturbations (Jakob
  /// and Marschner 2012) above all, and not Langevin steps, in turns; more than 0 with a pinhole
  /// only. None: all with a pinhole, else none.
  std::optional<double> last_perturbations = std::nullopt;
  /// Samples of each round of the pilot.
  int pilot = 16384;
};

/// Delayed rejection (Tierney and Mira 1999; Green and Mira 2001; in light transport Rioux-Lavoie
/// et al. 2020): a small step that is rejected is followed by a second, smaller one.
struct DelayedRejection {
  bool on = false;
  double second_scale = 0.2;  ///< of that step, over the first

  /// The scale if it is on.
  std::optional<double> scale() const { return on ? std::optional(second_scale) : std::nullopt; }
};

/// The Langevin sampler of [E63].
struct LangevinOptions {
  Mode mode = Mode::Splitting;
  KernelOptions kernel;
  RedistributionOptions redistribution;
  SplittingOptions splitting;
  PhaseSpace phase_space = PhaseSpace::Bidirectional;
  /// None: the fraction n_eff / n = E[w]^2 / E[w^2] of the bootstrap's samples that independent
  /// samples of f would be worth, within [0.1, 0.9]. Where it is high large steps alone do; where
  /// it is low more of them cost time and change little. Fixed before the chains start.
  std::optional<double> large_step_probability;
  LargeSteps large_steps = LargeSteps::Bdpt;
  DirectLight direct = DirectLight::Apart;
  DelayedRejection delayed_rejection;
  /// Of Mode::Chain: a pilot tunes the scale of small steps until so many of them are accepted; 0:
  /// it is as given.
  double target_acceptance = 0;
  /// Independent chains, whatever the number of threads.
  int chains = 128;
  /// Samples that estimate the normalization b and start the chains.
  int bootstrap = 500000;
  /// Longest path, in edges.
  int max_depth = 12;

  /// Throws OptionError.
  void validate() const;
};

/// The path tracer.
struct PathOptions {
  int max_depth = 12;

  /// Throws OptionError.
  void validate() const;
};

/// How the strategies that can make a path share it, by their densities p_i (Veach 1997, 9.2).
enum class MisHeuristic {
  Balance = 0,  ///< p_i / sum_j p_j
  Power = 1,    ///< p_i^2 / sum_j p_j^2
};

/// The bidirectional path tracer.
struct BdptOptions {
  int max_depth = 12;
  MisHeuristic heuristic = MisHeuristic::Power;

  /// Throws OptionError.
  void validate() const;
};

/// The light tracer.
struct LightOptions {
  int max_depth = 12;

  /// Throws OptionError.
  void validate() const;
};

/// Metropolis sampling of primary samples.
struct PrimaryOptions {
  /// Probability of drawing all numbers anew.
  double large_step_probability = 0.3;
  /// Sizes between which small steps are drawn log-uniformly (Kelemen et al. 2002).
  double step_min = 1.0 / 1024.0;
  double step_max = 1.0 / 64.0;
  /// The second step is of the sizes of Kelemen et al. times its scale.
  DelayedRejection delayed_rejection;
  DirectLight direct = DirectLight::Apart;
  /// Independent chains, whatever the number of threads.
  int chains = 128;
  /// Samples that estimate the normalization b and start the chains.
  int bootstrap = 200000;
  /// Longest path, in edges.
  int max_depth = 12;

  /// Throws OptionError.
  void validate() const;
};

/// Of all strategies together (Kelemen et al. 2002).
struct PssmltOptions : PrimaryOptions {};
/// How chains whose states are paths of one strategy each draw independent proposals.
enum class StrategyLargeSteps {
  One,  ///< of one strategy; chains keep the length of their paths (Hachisuka et al. 2014)
  All,  ///< a bidirectional sample, of which one path goes on (as in the program of Luan et al.
        ///< 2020)
};

/// Of one strategy at a time, which is a coordinate (Hachisuka et al. 2014).
struct MmltOptions : PrimaryOptions {
  StrategyLargeSteps large_steps = StrategyLargeSteps::All;

  /// Throws OptionError.
  void validate() const;
};

/// As MmltOptions, with small steps that know derivatives of the target (gaussian_step.h).
struct GaussianStepOptions : MmltOptions {
  /// Share of the small steps that are those of Kelemen et al. all the same. With
  /// StrategyLargeSteps::One they alone change the strategy.
  double isotropic_probability = 0.1;
};
/// Hessian-Hamiltonian dynamics (Li et al. 2015).
struct H2mcOptions : GaussianStepOptions {
  /// Standard deviation of the isotropic prior of a step.
  double sigma = 0.02;

  /// Throws OptionError.
  void validate() const;
};
/// Langevin dynamics with a diagonal preconditioner that adapts to gradients (Luan et al. 2020).
struct LmcOptions : GaussianStepOptions {
  /// Time step: the variance of a step, over the preconditioner.
  double step = 0.005;
  /// Standard deviation of the isotropic prior of a step.
  double sigma = 0.02;
  /// Longer gradients are cut to this length.
  double gradient_bound = 100;
  /// Weight of former gradients in the drift at first; it falls off as t^-adaptation_decay.
  double momentum = 0.9;
  /// Weight of the current gradient in the preconditioner; former ones have the rest.
  double locality = 0.5;
  /// The t-th gradient gets the weight t^-adaptation_decay among former ones.
  double adaptation_decay = 0.7;
  /// Points of each strategy at which chains of a pilot remember gradients, for all steps of the
  /// render; 0: its own chains do, as they go.
  int cache = 0;

  /// Throws OptionError.
  void validate() const;
};

/// The Langevin step of [E63] in primary sample space, with its matrix from the constraints of the
/// path.
struct MalaOptions : GaussianStepOptions {
  /// Without Drift::Full, PreconditionerKind::Hessian and apertures. The radius of the trust region
  /// is `trust` / 2, half of the circle that a number is on.
  KernelOptions kernel;
  /// A pilot tunes the scale until so many Langevin steps are accepted; 0: it is as given.
  double target_acceptance = 0;

  /// Throws OptionError.
  void validate() const;
};

/// Mutations of a path by its vertices (Veach and Guibas 1997): the perturbations and their steps.
struct PerturbationOptions {
  /// Share of the perturbations that are manifold perturbations (Jakob and Marschner 2012), where
  /// the path has one.
  double manifold_probability = 0.25;
  /// Sizes between which they are drawn log-uniformly, in widths of the film; directions move by
  /// the angle that so much of the field of view is.
  double step_min = 1.0 / 2048.0;
  double step_max = 1.0 / 10.0;
  DelayedRejection delayed_rejection;
  DirectLight direct = DirectLight::Apart;
  /// Longest path, in edges.
  int max_depth = 12;
};
/// Metropolis light transport (Veach and Guibas 1997).
struct MltOptions : PerturbationOptions {
  /// Probability of a bidirectional mutation; the others are perturbations.
  double bidirectional_probability = 0.3;
  /// Independent chains, whatever the number of threads.
  int chains = 128;
  /// Samples that estimate the normalization b and start the chains.
  int bootstrap = 500000;

  /// Throws OptionError.
  void validate() const;
};
/// Energy redistribution path tracing (Cline, Talbot and Egbert 2005).
struct ErptOptions : PerturbationOptions {
  /// Mutations of a chain.
  int chain_length = 100;
  /// Mutations for each bidirectional sample, in the mean.
  double mutations_per_sample = 100;
  /// Samples that find how much light each mutation deposits.
  int pilot = 65536;

  /// Throws OptionError.
  void validate() const;
};

/// As options name it.
std::string_view name_of(PhaseSpace phase_space);

/// One option by name, bound to a field.
struct OptionEntry {
  std::string_view name;
  std::string values;  ///< what it accepts
  std::string_view help;
  std::function<std::string()> get;
  std::function<void(const std::string&)> set;  ///< throws OptionError

  /// The setting of another option without which this one does nothing, and whether it is made.
  struct Condition {
    std::string_view text;
    std::function<bool()> holds;
  };
  std::optional<Condition> condition = std::nullopt;
};

/// The options of an integrator, in the order in which they are listed.
std::vector<OptionEntry> entries(LangevinOptions& options);
std::vector<OptionEntry> entries(PathOptions& options);
std::vector<OptionEntry> entries(BdptOptions& options);
std::vector<OptionEntry> entries(LightOptions& options);
std::vector<OptionEntry> entries(PrimaryOptions& options);
std::vector<OptionEntry> entries(MmltOptions& options);
std::vector<OptionEntry> entries(H2mcOptions& options);
std::vector<OptionEntry> entries(LmcOptions& options);
std::vector<OptionEntry> entries(MalaOptions& options);
std::vector<OptionEntry> entries(MltOptions& options);
std::vector<OptionEntry> entries(ErptOptions& options);

/// Sets `name` to `value`. Throws OptionError naming the option and the valid ones or values.
void set_option(const std::vector<OptionEntry>& entries, const std::string& name,
                const std::string& value);

/// Throws OptionError if the option does nothing beside the values that the others have.
void check_condition(const std::vector<OptionEntry>& entries, const std::string& name);

}  // namespace driftlight
