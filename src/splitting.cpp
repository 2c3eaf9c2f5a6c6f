// SPDX-License-Identifier: Apache-2.0
#include "splitting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "mixed_chain.h"
#include "mutation_loop.h"

namespace driftlight {
namespace {

/// Most copies of a particle; beyond them its weight grows.
constexpr double kMostCopies = 64;
/// Steps at each softer level; and where narrow lobes are softened: else the particles that start
/// in the middle of all of them would carry most of the light.
constexpr int kSteps = 4;
constexpr int kStepsInLobes = 16;

/// Share of manifold perturbations among those of the last steps: the others mostly miss the light,
/// which is hard to find again.
constexpr double kManifolds = 0.9;

/// So many copies, each with its weight times `factor`: ratio in the mean.
struct Copies {
  int count;
  double factor;
};

Copies copies(double ratio, Rng& rng) {
  const double u = rng.uniform();
  if (ratio > kMostCopies) return {static_cast<int>(kMostCopies), ratio / kMostCopies};
  return {ratio > 0.0 ? static_cast<int>(std::floor(ratio + u)) : 0, 1.0};
}

/// The kernel of particles in the scene itself.
KernelOptions last_kernel(const LangevinOptions& options) {
  KernelOptions kernel = options.kernel;
  kernel.trust = options.splitting.trust;
  return kernel;
}

/// At the softer levels, where short steps would waste those few that there are.
KernelOptions level_kernel(const LangevinOptions& options) {
  KernelOptions kernel = last_kernel(options);
  kernel.scale *= options.splitting.scale;
  kernel.scale_decades *= 0.5;
  return kernel;
}

void add_to(LevelFigures& level, const ChainFigures& walked) {
  level.steps += walked.small_step;
  level.second_steps += walked.second_step;
  level.rejections += walked.rejections;
}

}  // namespace

bool SplittingPlan::takes(LobeSequence sequence) const {
  if (!some) return false;
  return unseen ? !std::binary_search(left.begin(), left.end(), sequence)
                : std::binary_search(taken.begin(), taken.end(), sequence);
}

/// The particle at one level above the last.
struct Splitter::Level {
  Level(const Scene& of_scene, const KernelOptions& kernel, std::optional<double> second_scale)
      : scene(of_scene), small_step(of_scene, kernel, second_scale) {}

  void enter(const PathTopology& topology, const PathCoordinates& coordinates,
             const Contribution& at) {
    start.topology = topology;
    start.coordinates = coordinates;
    start.contribution = at;
    start.has_step = false;
    current = &start;
  }

  const Scene& scene;
  SmallStep small_step;
  ChainState start;
  std::array<ChainState, 3> memory;
  ChainState* current = &start;
};

struct Splitter::Particles {
  /// A path of the top level that so many particles start from, of so many times the deposit.
  struct Start {
    PathTopology topology;
    PathCoordinates coordinates;
    int count;
    double factor;
  };
  struct Sink;

  Particles(const TemperedScenes& with_scenes, const LangevinOptions& with,
            const Remainder& of_remainder, const BrightnessMap& with_brightness, StepLayers* layers)
      : scenes(with_scenes),
        options(with),
        remainder(of_remainder),
        brightness(with_brightness),
        scene(scenes[0]),
        kernel_of_last(last_kernel(options)),
        kernel_of_levels(level_kernel(options)),
        steps(options.splitting.steps.value_or(scenes.soften_lobes() ? kStepsInLobes : kSteps)),
        last(scene, options, kernel_of_last,
             options.splitting.last_perturbations.value_or(is_pinhole(scene.camera())), kManifolds,
             remainder, layers),
        figures(static_cast<std::size_t>(scenes.top()) + 1) {
    for (int k = 1; k <= scenes.top(); ++k)
      levels.push_back(
          std::make_unique<Level>(scenes[k], kernel_of_levels, options.delayed_rejection.scale()));
  }

  Level& level(int k) { return *levels[static_cast<std::size_t>(k - 1)]; }
  LevelFigures& figures_of(int k) { return figures[static_cast<std::size_t>(k)]; }

  double log_target(const Contribution& c) const {
    return c.log_target - std::log(brightness(c.film));
  }

  /// Steps that leave pi_k invariant.
  void walk(int k, Rng& rng) {
    Level& at = level(k);
    const auto propose = [&](ChainState& from, ChainState& to, MutationStage stage, Rng& numbers,
                             Rejections& rejections) {
      const bool proposed = stage == MutationStage::Second
                                ? at.small_step.propose_again(from, to, numbers, rejections)
                                : at.small_step.propose(from, to, numbers, rejections);
      if (!proposed) return 0.0;
      const auto densities = at.small_step.log_densities(from, to, rejections);
      if (!densities) return 0.0;
      return acceptance_ratio(log_target(from.contribution), log_target(to.contribution),
                              densities->forward, densities->reverse);
    };
    ChainFigures walked;
    at.current = &run_mutations(
        at.start, at.memory, {static_cast<std::uint64_t>(steps), at.small_step.delays_rejection()},
        rng, walked, propose, [](const ChainState&, double) {});
    add_to(figures_of(k), walked);
  }

  /// From level k > 0, with a particle there, to the end.
  void descend(int k, double deposit, Rng& rng) {
    ++figures_of(k).particles;
    walk(k, rng);
    const ChainState& from = *level(k).current;
    const double log_from = log_target(from.contribution);
    if (k == 1) return arrive(from, log_from, deposit, rng);
    const Contribution c = contribution(level(k - 1).scene, from.topology, from.coordinates);
    const Copies next = next_copies(k, log_target(c) - log_from, rng);
    for (int i = 0; i < next.count; ++i) {
      level(k - 1).enter(from.topology, from.coordinates, c);
      descend(k - 1, deposit * next.factor, rng);
    }
  }

  /// From level k on, to a target that is so many times as large.
  Copies next_copies(int k, double log_ratio, Rng& rng) {
    const double ratio = std::isnan(log_ratio) ? 0.0 : std::exp(log_ratio);
    const Copies next = copies(ratio, rng);
    LevelFigures& counts = figures_of(k);
    counts.ratio += ratio;
    counts.squared_ratio += ratio * ratio;
    if (next.count == 0) ++counts.died;
    return next;
  }

  /// At level 0.
  void arrive(const ChainState& from, double log_from, double deposit, Rng& rng) {
    const auto topology = scenes.at_level_0(from.topology, from.coordinates);
    Contribution c;
    Share share;
    share.log_remainder = -kInfinity;
    if (topology) {
      c = contribution(scene, *topology, from.coordinates);
      if (std::isfinite(c.log_target)) share = remainder.share(*topology, from.coordinates, c);
    }
    const Copies next = next_copies(1, share.log_remainder - log_from, rng);
    for (int i = 0; i < next.count; ++i)
      finish(*topology, from.coordinates, c, share, deposit * next.factor, rng);
  }

  void finish(const PathTopology& topology, const PathCoordinates& coordinates,
              const Contribution& c, const Share& share, double deposit, Rng& rng) {
    ++figures_of(0).particles;
    const LobeSequence sequence(topology);
    const auto visits = static_cast<std::uint64_t>(options.splitting.last_steps);
    const auto report = [&](const Share& at, const Rgbd& color, double weight) {
      (*visit)(sequence, number, at, color, weight * deposit / options.splitting.last_steps);
    };
    last.start_at({topology, coordinates, c, share});
    last.run(visits, rng, report);
  }

  const TemperedScenes& scenes;
  const LangevinOptions& options;
  const Remainder& remainder;
  const BrightnessMap& brightness;
  const Scene& scene;
  KernelOptions kernel_of_last;
  KernelOptions kernel_of_levels;
  int steps;                                   ///< at each softer level
  std::vector<std::unique_ptr<Level>> levels;  ///< 1 and above
  MixedChain last;
  std::vector<LevelFigures> figures;
  std::vector<Start> starts;
  const Visit* visit = nullptr;
  int number = 0;  ///< of the particle under way, among those of this sample
};

/// Finds starts among the paths of one sample.
struct Splitter::Particles::Sink {
  const Scene& scene;
  const BrightnessMap& brightness;
  const SplittingPlan& plan;
  PhaseSpace phase_space;
  Vec2d film;
  Rng& rng;
  std::vector<Start>& starts;

  void add(const Rgbd& value, const FoundPath& path) { splat(film, value, path); }
  void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
    const double w = luminance(value) / brightness(at);
    if (!std::isfinite(w)) return;
    const Copies particles = copies(w / plan.deposit, rng);
    if (particles.count == 0) return;
    const auto state = state_of(scene, path, phase_space);
    if (state && plan.takes(LobeSequence(state->topology)))
      starts.push_back({state->topology, state->coordinates, particles.count, particles.factor});
  }
};

Splitter::Splitter(const TemperedScenes& scenes, const EmissionGuide& top_guide,
                   const LangevinOptions& options, const Remainder& remainder,
                   const BrightnessMap& brightness, StepLayers* layers)
    : scenes_(scenes),
      options_(options),
      remainder_(remainder),
      brightness_(brightness),
      layers_(layers),
      tracer_(scenes[scenes.top()], top_guide, MisHeuristic::Balance, options.max_depth) {}

Splitter::Splitter(const Splitter& other)
    : scenes_(other.scenes_),
      options_(other.options_),
      remainder_(other.remainder_),
      brightness_(other.brightness_),
      layers_(other.layers_),
      tracer_(other.tracer_) {}

Splitter::~Splitter() = default;

void Splitter::sample(const Vec2d& film, const SplittingPlan& plan, Rng& rng, const Visit& visit) {
  const int top = scenes_.top();
  if (!particles_)
    particles_ = std::make_unique<Particles>(scenes_, options_, remainder_, brightness_, layers_);
  Particles& particles = *particles_;
  particles.visit = &visit;
  particles.starts.clear();
  particles.number = 0;
  Particles::Sink sink{scenes_[top], brightness_,     plan, options_.phase_space, film,
                       rng,          particles.starts};
  tracer_.sample(film, rng, sink);
  for (const Particles::Start& start : particles.starts) {
    const Contribution c = contribution(scenes_[top], start.topology, start.coordinates);
    if (!std::isfinite(c.log_target)) continue;
    for (int i = 0; i < start.count; ++i) {
      particles.level(top).enter(start.topology, start.coordinates, c);
      particles.descend(top, plan.deposit * start.factor, rng);
      ++particles.number;
    }
  }
}

std::vector<LevelFigures> Splitter::take_figures() {
  if (!particles_) return {};
  add_to(particles_->figures_of(0), particles_->last.take_statistics());
  std::vector<LevelFigures> figures(particles_->figures.size());
  std::swap(figures, particles_->figures);
  return figures;
}

}  // namespace driftlight
