// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <type_traits>
#include <utility>

#include "cli/commands.h"
#include "cli/interrupt.h"
#include "cli/max_depth.h"
#include "cli/print.h"
#include "cli/progress_bar.h"
#include "cli/report.h"
#include "cli/text_file.h"
#include "driftlight/image.h"
#include "driftlight/render.h"
#include "driftlight/scene_file.h"
#include "driftlight/step_layers.h"
#include "pending_file.h"
#include "stopwatch.h"

namespace driftlight::cli {

namespace {

struct Rendered {
  Image image;
  Report report;
};

constexpr double kMutationsPerPixel = 100;
constexpr int kSamplesPerPixel = 64;

int samples_per_pixel(const RenderCommand& command) {
  return command.samples_per_pixel.value_or(kSamplesPerPixel);
}

double mutations_per_pixel(const RenderCommand& command) {
  return command.mutations_per_pixel.value_or(kMutationsPerPixel);
}

LangevinResult render_with(const Scene& scene, const LangevinOptions& options,
                           const RenderOptions& render, const RenderCommand& command) {
  const double work = options.mode == Mode::Chain ? mutations_per_pixel(command)
                                                  : static_cast<double>(samples_per_pixel(command));
  return render_langevin(scene, options, render, work);
}

LangevinResult render_with(const Scene& scene, const PssmltOptions& options,
                           const RenderOptions& render, const RenderCommand& command) {
  return render_pssmlt(scene, options, render, mutations_per_pixel(command));
}

LangevinResult render_with(const Scene& scene, const MmltOptions& options,
                           const RenderOptions& render, const RenderCommand& command) {
  return render_mmlt(scene, options, render, mutations_per_pixel(command));
}

PathResult render_with(const Scene& scene, const PathOptions& options, const RenderOptions& render,
                       const RenderCommand& command) {
  return render_path(scene, options, render, samples_per_pixel(command));
}

PathResult render_with(const Scene& scene, const BdptOptions& options, const RenderOptions& render,
                       const RenderCommand& command) {
  return render_bdpt(scene, options, render, samples_per_pixel(command));
}

PathResult render_with(const Scene& scene, const LightOptions& options, const RenderOptions& render,
                       const RenderCommand& command) {
  return render_light(scene, options, render, samples_per_pixel(command));
}

Report report_of(const RenderCommand& /*command*/, const LangevinResult& result,
                 const LangevinOptions& options, const std::vector<OptionEntry>& entries,
                 const RenderOptions& render) {
  return make_report(result, options, entries, render);
}

template <class Options, class Result>
Report report_of(const RenderCommand& command, const Result& result, const Options& /*options*/,
                 const std::vector<OptionEntry>& entries, const RenderOptions& render) {
  return make_report(std::string(name_of(command.integrator)), result, entries, render);
}

void check_outputs(const RenderCommand& command) {
  for (const auto& file : command.outputs) check_writable(file);
  if (command.statistics) check_target(*command.statistics);
  if (command.layers) check_target(*command.layers);
  if (command.strategies) check_target(*command.strategies);
  if (command.shares) check_target(*command.shares);
}

/// Shows nothing if quiet, the rest by degrees.
class Talk {
 public:
  explicit Talk(Verbosity verbosity) : verbosity_(verbosity) {}

  bool quiet() const { return verbosity_ == Verbosity::Quiet; }
  void notice(const std::string& text) const {
    if (!quiet()) print_notice(text);
  }
  void summary(const std::vector<std::string>& lines) const {
    if (!quiet()) print_lines(lines);
  }
  void details(const std::vector<std::string>& lines) const {
    if (verbosity_ == Verbosity::Verbose) print_lines(lines);
  }

 private:
  static void print_lines(const std::vector<std::string>& lines) {
    for (const std::string& line : lines) print(line + "\n");
  }

  Verbosity verbosity_;
};

/// Applies the settings, before anything takes time; true if one of them is the depth.
bool apply_settings(const RenderCommand& command, const std::vector<OptionEntry>& options) {
  bool has_depth = false;
  for (const auto& [name, value] : command.settings) {
    set_option(options, name, value);
    has_depth = has_depth || name == "max_depth";
  }
  return has_depth;
}

/// Flags that this mode or kernel has no use for.
template <class Options>
void check_settings(const RenderCommand& command, const Options& options) {
  if constexpr (std::is_same_v<Options, LangevinOptions>) {
    const bool chain = options.mode == Mode::Chain;
    if (chain && command.samples_per_pixel)
      throw UsageError(
          "--spp is for the path, bdpt and light integrators and for mode=splitting and "
          "mode=redistribution; mode=chain takes --mutations-per-pixel");
    if (!chain && command.mutations_per_pixel)
      throw UsageError(
          "--mutations-per-pixel is for mode=chain; mode=splitting and mode=redistribution take "
          "--spp");
    if (chain && command.shares)
      throw UsageError("--shares is for mode=splitting and mode=redistribution");
    const KernelOptions& kernel = options.kernel;
    if (command.check_gradients && kernel.drift == Drift::None &&
        kernel.preconditioner == PreconditionerKind::Identity)
      throw UsageError(
          "--check-gradients: drift=none with preconditioner=identity uses no derivatives");
  }
}

void write_outputs(const RenderCommand& command, const Image& image, const RenderOptions& render,
                   Report& report, const Talk& talk) {
  const Stopwatch watch;
  for (const auto& file : command.outputs) {
    write_image(file, image, report.metadata);
    report.summary.push_back(fmt::format("wrote {}", file.string()));
  }
  if (render.layers != nullptr) {
    write_layers(*command.layers, render.layers->develop(), report.metadata);
    report.summary.push_back(fmt::format("wrote {}", command.layers->string()));
  }
  if (render.strategies != nullptr) {
    write_layers(*command.strategies, *render.strategies, report.metadata);
    report.summary.push_back(fmt::format("wrote {}", command.strategies->string()));
  }
  if (render.shares != nullptr) {
    write_layers(*command.shares, *render.shares, report.metadata);
    report.summary.push_back(fmt::format("wrote {}", command.shares->string()));
  }
  report.statistics["seconds"]["write"] = watch.seconds();
  if (command.statistics) {
    write_text(*command.statistics, report.statistics.dump(2) + "\n");
    report.summary.push_back(fmt::format("wrote {}", command.statistics->string()));
  }
  talk.summary(report.summary);
  talk.details(report.details);
}

template <class Options>
void render(const RenderCommand& command) {
  const Talk talk(command.verbosity);
  Options options;
  const std::vector<OptionEntry> option_entries = entries(options);
  const bool has_depth = apply_settings(command, option_entries);
  check_settings(command, options);
  check_outputs(command);

  const Stopwatch watch;
  const LoadedScene loaded = load_scene(command.scene.file, {.defines = command.scene.defines});
  const double load_seconds = watch.seconds();
  for (const std::string& notice : loaded.notices) talk.notice(notice);
  if (!has_depth) {
    const MaxDepth depth = max_depth(loaded, options.max_depth);
    options.max_depth = depth.edges;
    if (!depth.notice.empty()) talk.notice(depth.notice);
  }

  RenderOptions how;
  how.threads = command.threads;
  how.seed = command.seed;
  how.time = command.time;
  how.check_gradients = command.check_gradients;
  how.stop = &stop_on_interrupt();
  std::optional<StepLayers> layers;
  if (command.layers) {
    const PerspectiveCamera& camera = loaded.scene.camera();
    how.layers = &layers.emplace(camera.film_width, camera.film_height);
  }
  Layers strategies;
  if (command.strategies) how.strategies = &strategies;
  Layers shares;
  if (command.shares) how.shares = &shares;
  const auto result = [&] {
    ProgressBar bar(!talk.quiet());
    how.progress = [&](const Progress& progress) { bar.update(progress); };
    return render_with(loaded.scene, options, how, command);
  }();
  Report report = report_of(command, result, options, option_entries, how);
  if (report.empty) throw RuntimeError("stopped before there was an image; nothing is written");
  if (report.stopped) talk.notice("stopped early: the image holds what was rendered so far");
  for (const std::string& warning : report.warnings) talk.notice(warning);
  report.statistics["seconds"]["load"] = load_seconds;
  write_outputs(command, result.image, how, report, talk);
  if (!report.failure.empty()) throw RuntimeError(report.failure);
}

}  // namespace

void run(const RenderCommand& command) {
  switch (command.integrator) {
    case Integrator::Langevin:
      return render<LangevinOptions>(command);
    case Integrator::Pssmlt:
      return render<PssmltOptions>(command);
    case Integrator::Mmlt:
      return render<MmltOptions>(command);
    case Integrator::Path:
      return render<PathOptions>(command);
    case Integrator::Bdpt:
      return render<BdptOptions>(command);
    case Integrator::Light:
      return render<LightOptions>(command);
  }
}

}  // namespace driftlight::cli
