// SPDX-License-Identifier: Apache-2.0
/// Energy redistribution path tracing (Cline, Talbot and Egbert 2005).
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "chain_counts.h"
#include "chain_schedule.h"
#include "direct_pass.h"
#include "driftlight/error.h"
#include "driftlight/film.h"
#include "driftlight/small_step.h"
#include "mutation_loop.h"
#include "pass_loop.h"
#include "path_mutation.h"
#include "sample_film.h"
#include "vertex_path.h"

namespace driftlight {
namespace {

/// What all samples of a render share.
struct Energy {
  const Scene& scene;
  const ErptOptions& options;
  EmissionGuide unguided;
  int min_edges;  ///< of paths whose light is left to chains
  PathMutation mutation;
  Film film;       ///< of the chains, in units of `unit`
  double deposit;  ///< e_d, of a mutation
  double unit;     ///< so bright that fixed point does not overflow

  Energy(const Scene& of_scene, const ErptOptions& with, std::uint64_t seed)
      : scene(of_scene),
        options(with),
        unguided(scene),
        min_edges(options.direct == DirectLight::Apart ? kDirectDepth + 1 : 1),
        mutation(scene, {min_edges, options.max_depth, options.step_min, options.step_max,
                         options.manifold_probability}),
        film(scene.camera().film_width, scene.camera().film_height, scene.camera().filter),
        deposit(mean_of_samples(seed) / options.mutations_per_sample),
        unit(1024.0 * (deposit > 0.0 ? deposit : 1.0)) {}

  bool is_for_chains(const FoundPath& path) const { return path.s + path.t - 1 >= min_edges; }
  BidirectionalTracer tracer() const {
    return {scene, unguided, MisHeuristic::Balance, options.max_depth};
  }

  ChainCounts counts;  ///< of the chains

 private:
  /// Adds up what a sample finds for the chains.
  struct SumSink {
    const Energy& energy;
    double sum = 0;

    void add(const Rgbd& value, const FoundPath& path) {
      const double y = luminance(value);
      if (energy.is_for_chains(path) && std::isfinite(y)) sum += y;
    }
    void splat(const Vec2d&, const Rgbd& value, const FoundPath& path) { add(value, path); }
  };

  /// Mean over the samples of a pilot of what they find for the chains.
  double mean_of_samples(std::uint64_t seed) const {
    constexpr std::size_t kTask = 256;
    const auto count = static_cast<std::size_t>(options.pilot);
    std::vector<double> sums((count + kTask - 1) / kTask);
    tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t task) {
      BidirectionalTracer samples = tracer();
      SumSink sink{*this};
      for (std::size_t i = task * kTask; i < std::min((task + 1) * kTask, count); ++i) {
        Rng rng(seed, Stream::Pilot, i);
        const Vec2d at = rng.uniform2();
        samples.sample(at, rng, sink);
      }
      sums[task] = sink.sum;
    });
    double total = 0;
    for (const double sum : sums) total += sum;
    return total / static_cast<double>(count);
  }
};

/// One bidirectional sample, and the chains that start from the paths that it finds.
class EnergySampler {
 public:
  explicit EnergySampler(Energy& energy) : energy_(energy), tracer_(energy.tracer()) {}

  void sample(const Vec2d& film, Rng& rng, SampleFilm::Sink& film_sink) {
    starts_.clear();
    Sink sink{*this, film, film_sink};
    tracer_.sample(film, rng, sink);
    ChainFigures figures;
    std::uint64_t starts = 0;
    for (Start& start : starts_)
      if (redistribute(start, rng, figures)) ++starts;
    if (!starts_.empty()) energy_.counts.add(figures, starts);
  }

 private:
  struct Start {
    VertexPath path;
    double value;  ///< luminance of what the sample is worth
  };

  struct Sink {
    EnergySampler& sampler;
    Vec2d film;
    SampleFilm::Sink& film_sink;

    void add(const Rgbd& value, const FoundPath& path) {
      if (!sampler.keep(value, path)) film_sink.add(value);
    }
    void splat(const Vec2d& at, const Rgbd& value, const FoundPath& path) {
      if (!sampler.keep(value, path)) film_sink.splat(at, value);
    }
  };

  /// Whether the path is left to chains.
  bool keep(const Rgbd& value, const FoundPath& path) {
    const double y = luminance(value);
    if (!energy_.is_for_chains(path) || !(energy_.deposit > 0.0) || !std::isfinite(y)) return false;
    if (!(y > 0.0)) return true;
    starts_.push_back({vertex_path(path), y});
    if (starts_.back().path.evaluate(energy_.scene)) return true;
    starts_.pop_back();
    return false;
  }

  /// By chains of mutations that deposit e_d each; false if it starts none.
  bool redistribute(Start& start, Rng& rng, ChainFigures& figures) {
    const auto [chains, mutations, deposit] =
        schedule_chains(start.value, energy_.deposit, energy_.options.chain_length, rng);
    for (double i = 0; i < chains; ++i)
      run(start.path, static_cast<std::uint64_t>(mutations), deposit / energy_.unit, rng, figures);
    return chains > 0.0;
  }

  void run(VertexPath& start, std::uint64_t mutations, double weight, Rng& rng,
           ChainFigures& figures) {
    const DelayedRejection& delayed_rejection = energy_.options.delayed_rejection;
    const auto propose = [&](const VertexPath& x, VertexPath& y, MutationStage stage, Rng& numbers,
                             Rejections& rejections) {
      const double size = stage == MutationStage::Second ? delayed_rejection.second_scale : 1.0;
      return energy_.mutation.propose(x, y, size, numbers, rejections);
    };
    run_mutations(start, paths_, {mutations, delayed_rejection.on}, rng, figures, propose,
                  [&](const VertexPath& at, double share) {
                    const Contribution& value = at.contribution();
                    energy_.film.splat(value.film, value.color, share * weight);
                  });
  }

  Energy& energy_;
  BidirectionalTracer tracer_;
  std::array<VertexPath, 3> paths_;
  std::vector<Start> starts_;
};

}  // namespace

LangevinResult render_erpt(const Scene& scene, const ErptOptions& options,
                           const RenderOptions& render, int samples_per_pixel) {
  options.validate();
  require_pinhole(scene, "the integrator 'erpt'");
  LangevinResult result;
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  arena.execute([&] {
    RenderClock clock(render);
    Energy energy(scene, options, render.seed);
    const double pilot_seconds = clock.seconds();
    SampleFilm film(scene.camera(), render.seed, 0);
    const EnergySampler sampler(energy);
    const auto by_chains = [&](double passes) {
      return energy.film.develop(energy.unit / std::max(1.0, passes));
    };
    PathResult samples = run_passes(
        render, clock, samples_per_pixel, [&](std::uint64_t index) { film.pass(index, sampler); },
        [&](double passes) {
          Image image = film.image(passes);
          const Image chains = by_chains(passes);
          for (std::size_t i = 0; i < image.rgb.size(); ++i) image.rgb[i] += chains.rgb[i];
          return image;
        });
    result.image = std::move(samples.image);
    result.statistics = energy.counts.statistics();
    result.statistics.b = mean_luminance(result.image);
    if (!(result.statistics.b > 0.0) && !samples.stopped)
      throw InputError("no path from the sensor to an emitter carries light");
    result.statistics.remainder = mean_luminance(by_chains(samples.samples_per_pixel));
    result.statistics.samples_per_pixel = samples.samples_per_pixel;
    result.statistics.stopped = samples.stopped;
    result.statistics.bootstrap_seconds = pilot_seconds;
    result.statistics.render_seconds = samples.render_seconds;
  });
  return result;
}

}  // namespace driftlight
