// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <variant>

#include "cli/commands.h"
#include "cli/integrator.h"
#include "cli/interrupt.h"
#include "cli/print.h"
#include "cli/progress_bar.h"
#include "cli/report.h"
#include "cli/scene.h"
#include "cli/text_file.h"
#include "driftlight/image.h"
#include "driftlight/render.h"
#include "driftlight/step_layers.h"
#include "pending_file.h"
#include "stopwatch.h"

namespace driftlight::cli {

namespace {

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

/// Flags that this mode or kernel has no use for.
void check_settings(const RenderCommand& command, const IntegratorOptions& options) {
  const auto* langevin = std::get_if<LangevinOptions>(&options);
  if (langevin == nullptr) return;
  const bool chain = counts_mutations(options);
  if (chain && command.work.samples_per_pixel)
    throw UsageError(
        "--spp is for the path, bdpt and light integrators and for mode=splitting and "
        "mode=redistribution; mode=chain takes --mutations-per-pixel");
  if (!chain && command.work.mutations_per_pixel)
    throw UsageError(
        "--mutations-per-pixel is for mode=chain; mode=splitting and mode=redistribution take "
        "--spp");
  if (chain && command.shares)
    throw UsageError("--shares is for mode=splitting and mode=redistribution");
  const KernelOptions& kernel = langevin->kernel;
  if (command.check_gradients && kernel.drift == Drift::None &&
      kernel.preconditioner == PreconditionerKind::Identity)
    throw UsageError(
        "--check-gradients: drift=none with preconditioner=identity uses no derivatives");
}

void write_outputs(const RenderCommand& command, const Image& image, const ToneMapping& tones,
                   const RenderOptions& render, Report& report, const Talk& talk) {
  const Stopwatch watch;
  for (const auto& file : command.outputs) {
    write_image(file, image, report.metadata, tones);
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

}  // namespace

void run(const RenderCommand& command) {
  const Talk talk(command.verbosity);
  IntegratorOptions options = options_of(command.integrator);
  apply(command.settings, options);
  check_settings(command, options);
  check_outputs(command);

  const Stopwatch watch;
  const LoadedScene loaded = load(command.scene);
  const double load_seconds = watch.seconds();
  for (const std::string& notice : loaded.notices) talk.notice(notice);
  const std::string depth_notice = take_depth(loaded, command.settings, options);
  if (!depth_notice.empty()) talk.notice(depth_notice);

  const SceneIdentity identity = identity_of(command.scene, loaded);
  Work work = command.work;
  const std::string sample_notice = take_sample_count(loaded, options, work);
  if (!sample_notice.empty()) talk.notice(sample_notice);

  RenderOptions how;
  how.threads = command.threads;
  how.seed = command.seed;
  how.time = command.work.time;
  how.check_gradients = command.check_gradients;
  how.stop = &stop_on_interrupt();
  std::optional<StepLayers> layers;
  if (command.layers) {
    const Camera& camera = loaded.scene.camera();
    how.layers = &layers.emplace(camera.film_width, camera.film_height);
  }
  Layers strategies;
  if (command.strategies) how.strategies = &strategies;
  Layers shares;
  if (command.shares) how.shares = &shares;
  auto [image, report] = [&] {
    ProgressBar bar(!talk.quiet());
    how.progress = [&](const Progress& progress) { bar.update(progress); };
    return render_with(loaded.scene, options, how, work);
  }();
  if (report.empty) throw RuntimeError("stopped before there was an image; nothing is written");
  if (report.stopped) talk.notice("stopped early: the image holds what was rendered so far");
  for (const std::string& warning : report.warnings) talk.notice(warning);
  report.statistics["seconds"]["load"] = load_seconds;
  add_scene(identity, report.metadata, report.statistics);
  write_outputs(command, image, loaded.tone_mapping, how, report, talk);
  if (!report.failure.empty()) throw RuntimeError(report.failure);
}

}  // namespace driftlight::cli
