// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "cli/commands.h"
#include "cli/gradient_report.h"
#include "cli/max_depth.h"
#include "cli/path_report.h"
#include "cli/print.h"
#include "cli/progress_bar.h"
#include "cli/scene.h"
#include "cli/text_file.h"
#include "driftlight/scene_check.h"
#include "pending_file.h"
#include "stopwatch.h"

namespace driftlight::cli {

namespace {

/// As a shell takes it.
std::string quoted(const std::string& text) {
  constexpr std::string_view kPlain =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-./=+,:@%";
  const bool plain = !text.empty() && text.find_first_not_of(kPlain) == std::string::npos;
  return plain ? text : "'" + text + "'";
}

std::string replay_line(const GradcheckCommand& command, std::uint64_t index) {
  std::string line = "driftlight gradcheck " + quoted(command.scene.file.string());
  for (const auto& [name, value] : command.scene.defines)
    line += fmt::format(" -D {}", quoted(fmt::format("{}={}", name, value)));
  if (command.scene.strict) line += " --strict";
  if (command.max_depth) line += fmt::format(" --max-depth {}", *command.max_depth);
  if (command.phase_space != LangevinOptions{}.phase_space)
    line += fmt::format(" --phase-space {}", name_of(command.phase_space));
  return line + fmt::format(" --seed {} --replay {}", command.seed, index);
}

void replay(const GradcheckCommand& command, const Scene& scene, int depth) {
  const std::uint64_t index = *command.replay;
  const auto path = draw_light_path(scene, depth, command.seed, index, command.phase_space);
  if (!path)
    throw InputError(fmt::format("there is no path {} of seed {}: no sample of it carries light",
                                 index, command.seed));
  const PathCheck check = check_path(scene, path->topology, path->coordinates);
  print(fmt::format("path {} of seed {}\n", index, command.seed) + path_text(scene, *path, check));
  if (!check.passes())
    throw RuntimeError(fmt::format("the derivatives of path {} are wrong", index));
}

nlohmann::ordered_json json_of(const GradcheckCommand& command, const SceneCheck& check, int depth,
                               double seconds) {
  nlohmann::ordered_json json{{"driftlight", DRIFTLIGHT_VERSION},
                              {"scene", command.scene.file.string()},
                              {"seed", command.seed},
                              {"max_depth", depth},
                              {"phase_space", name_of(command.phase_space)},
                              {"not_found", check.not_found},
                              {"not_reached", check.not_reached},
                              {"seconds", seconds}};
  json.update(to_json(check.table));
  return json;
}

void check(const GradcheckCommand& command, const Scene& scene, int depth) {
  SceneCheckOptions options;
  options.paths = command.paths;
  options.seed = command.seed;
  options.max_depth = depth;
  options.phase_space = command.phase_space;
  options.threads = command.threads;
  const Stopwatch watch;
  const SceneCheck check = [&] {
    ProgressBar bar(true);
    options.progress = [&](const Progress& progress) { bar.update(progress); };
    return check_scene(scene, options);
  }();
  const double seconds = watch.seconds();
  print(table_text(check.table));
  print(fmt::format("\n{} paths of up to {} edges in {} classes, {:.1f} s\n",
                    check.table.all().paths(), depth, check.table.classes().size(), seconds));
  if (check.not_found > 0)
    print(fmt::format("{} paths not found: light is too rare\n", check.not_found));
  for (const std::string& part : check.not_reached) print(fmt::format("not reached: {}\n", part));
  if (command.json) {
    write_text(*command.json, json_of(command, check, depth, seconds).dump(2) + "\n");
    print(fmt::format("wrote {}\n", command.json->string()));
  }
  const auto failures = check.table.failures();
  if (failures.empty()) return;
  std::string message = describe(failures.front());
  if (failures.front().kind == GradientFailure::Kind::Error)
    message += "; see " + replay_line(command, failures.front().index);
  throw RuntimeError(message);
}

}  // namespace

void run(const GradcheckCommand& command) {
  if (command.json) check_target(*command.json);
  const LoadedScene loaded = load(command.scene);
  for (const std::string& notice : loaded.notices) print_notice(notice);
  const MaxDepth depth = max_depth(loaded, LangevinOptions{}.max_depth);
  if (!command.max_depth && !depth.notice.empty()) print_notice(depth.notice);
  const int edges = command.max_depth.value_or(depth.edges);
  if (command.replay)
    replay(command, loaded.scene, edges);
  else
    check(command, loaded.scene, edges);
}

}  // namespace driftlight::cli
