// SPDX-License-Identifier: Apache-2.0
#include "cli/arguments.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <sstream>
#include <string_view>
#include <system_error>
#include <type_traits>

#include "cli/terms_study.h"
#include "driftlight/path.h"

namespace driftlight::cli {

namespace {

/// Parses the whole of `text` as a finite number of at least `low`, above it for floating point.
template <class T>
T parse_number(std::string_view flag, const std::string& text, T low) {
  T x{};
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, x);
  bool good = error == std::errc() && stop == end;
  std::string wanted = fmt::format("an integer from {} to {}", low, std::numeric_limits<T>::max());
  if constexpr (std::is_floating_point_v<T>) {
    good = good && std::isfinite(x) && x > low;
    wanted = fmt::format("a number > {}", low);
  }
  if (!good || x < low) throw UsageError(fmt::format("{} is '{}': must be {}", flag, text, wanted));
  return x;
}

std::pair<std::string, std::string> split_setting(std::string_view flag, const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == 0 || equals == std::string::npos)
    throw UsageError(fmt::format("{} is '{}': must be name=value", flag, text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

constexpr std::array<std::pair<Integrator, std::string_view>, 11> kIntegrators{
    {{Integrator::Langevin, "langevin"},
     {Integrator::Pssmlt, "pssmlt"},
     {Integrator::Mmlt, "mmlt"},
     {Integrator::H2mc, "h2mc"},
     {Integrator::Lmc, "lmc"},
     {Integrator::Mala, "mala"},
     {Integrator::Mlt, "mlt"},
     {Integrator::Erpt, "erpt"},
     {Integrator::Path, "path"},
     {Integrator::Bdpt, "bdpt"},
     {Integrator::Light, "light"}}};

/// The command line as text; its meaning comes afterwards.
struct Raw {
  std::string scene;
  std::vector<std::string> outputs;
  std::string integrator = "langevin";
  std::vector<std::string> defines;
  bool strict = false;
  std::vector<std::string> settings;
  std::optional<std::string> time;
  std::optional<std::string> mutations_per_pixel;
  std::optional<std::string> samples_per_pixel;
  std::string threads = "0";
  std::string seed = "0";
  std::string statistics;
  std::string layers;
  std::string strategies;
  std::string shares;
  bool check_gradients = false;
  std::string paths = "20000";
  std::string max_depth;
  std::string phase_space;
  std::string json_file;
  std::optional<std::string> replay;
  bool verbose = false;
  bool quiet = false;
  bool integrators = false;
  std::string image;
  std::string reference;
  bool json = false;
  std::string choices;
  std::string study;
  std::string runs = "3";
  std::string folder;
};

/// An option that may be repeated and takes one argument each time.
CLI::Option* add_repeatable(CLI::App& app, const std::string& flags, std::vector<std::string>& into,
                            const std::string& help) {
  return app.add_option(flags, into, help)->allow_extra_args(false);
}

/// How the scene is read.
void declare_scene_options(CLI::App& app, Raw& raw) {
  add_repeatable(app, "-D,--define", raw.defines, "value for $NAME in the scene; repeatable")
      ->type_name("NAME=VALUE");
  app.add_flag("--strict", raw.strict,
               "properties and attributes of the scene that nobody uses are errors");
}

void declare_render(CLI::App& app, Raw& raw) {
  app.add_option("scene", raw.scene, "Mitsuba scene file (XML)")->required()->type_name("SCENE");
  add_repeatable(app, "-o,--output", raw.outputs,
                 "image to write, by its ending: .exr, .pfm, .hdr, .png, ..; repeatable "
                 "(default: the scene's name with .exr, in this folder)")
      ->type_name("FILE");
  app.add_option("--integrator", raw.integrator,
                 "langevin, pssmlt, mmlt, h2mc, lmc, mala, mlt, erpt, path, bdpt or light")
      ->capture_default_str();
  declare_scene_options(app, raw);
  add_repeatable(app, "--set", raw.settings,
                 "option of the integrator, see `driftlight info --integrators`; repeatable")
      ->type_name("OPTION=VALUE");
  app.add_option("--time", raw.time, "render for this long")->type_name("SECONDS");
  app.add_option(
         "--mutations-per-pixel", raw.mutations_per_pixel,
         "work of langevin with mode=chain, pssmlt, mmlt, h2mc, lmc, mala and mlt (default: 100)")
      ->type_name("N");
  app.add_option("--spp", raw.samples_per_pixel,
                 "work of all others, samples per pixel (default: the scene's, else 64)")
      ->type_name("N");
  app.add_option("-t,--threads", raw.threads, "threads; 0: all")
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--seed", raw.seed, "seed of the random numbers")
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--stats", raw.statistics, "write statistics as JSON")->type_name("FILE");
  app.add_option("--layers", raw.layers,
                 "write what the small steps of the langevin integrator do in each pixel: "
                 "channels gradient_norm, acceptance, anisotropy, time_step, mutations")
      ->type_name("FILE.exr");
  app.add_option("--strategies", raw.strategies,
                 "write what each strategy of the bdpt integrator adds to the image: channels "
                 "sStT.R, sStT.G, sStT.B with S vertices from the light and T from the sensor")
      ->type_name("FILE.exr");
  app.add_option("--shares", raw.shares,
                 "write who carries what of the image of the langevin integrator: channels "
                 "samples, chains and particles, each with .R, .G, .B, and families, the effective "
                 "number of families of particles about a pixel")
      ->type_name("FILE.exr");
  app.add_flag("--check-gradients", raw.check_gradients,
               "check the derivatives at a random sample of the states of the langevin integrator");
  app.add_flag("-v,--verbose", raw.verbose, "say more at the end");
  app.add_flag("-q,--quiet", raw.quiet, "say nothing but errors");
}

void declare_compare(CLI::App& app, Raw& raw) {
  app.add_option("scene", raw.scene, "Mitsuba scene file (XML)")->required()->type_name("SCENE");
  app.add_option("--integrators", raw.choices,
                 "what to compare, separated by commas: integrators as `render` takes them, each "
                 "with options if need be, as in bdpt,langevin:mode=chain:scale=0.2")
      ->type_name("NAME[:OPTION=VALUE]..,..");
  app.add_option("--study", raw.study,
                 "terms: instead of --integrators, langevin with mode=chain and each "
                 "preconditioner, drift and time-step rule, at equal time and at equal mutations; "
                 "with options that all of them have if need be, as in terms:bootstrap=100000")
      ->type_name("STUDY[:OPTION=VALUE]..");
  app.add_option("--reference", raw.reference,
                 "image to measure errors against; without it they follow from the spread between "
                 "runs alone")
      ->type_name("FILE");
  app.add_option("-o,--out", raw.folder,
                 "folder to make: results.json, results.csv, report.html and images")
      ->required()
      ->type_name("DIR");
  app.add_option("--time", raw.time, "render each run for this long (default: 10)")
      ->type_name("SECONDS");
  app.add_option("--spp", raw.samples_per_pixel,
                 "instead of a time, the same work: samples per pixel")
      ->type_name("N");
  app.add_option("--mutations-per-pixel", raw.mutations_per_pixel,
                 "likewise, of langevin with mode=chain; may stand beside --spp, with --study "
                 "beside --time (default there: 100)")
      ->type_name("N");
  app.add_option("--runs", raw.runs, "independent runs of each, at least 2")
      ->type_name("N")
      ->capture_default_str();
  declare_scene_options(app, raw);
  app.add_option("-t,--threads", raw.threads, "threads; 0: all")
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--seed", raw.seed, "seed of the first run; each run has its own")
      ->type_name("N")
      ->capture_default_str();
}

void declare_gradcheck(CLI::App& app, Raw& raw) {
  app.add_option("scene", raw.scene, "Mitsuba scene file (XML)")->required()->type_name("SCENE");
  declare_scene_options(app, raw);
  app.add_option("--paths", raw.paths, "paths to check")->type_name("N")->capture_default_str();
  app.add_option("--max-depth", raw.max_depth, "longest path, in edges (default: as render)")
      ->type_name("N");
  app.add_option("--phase-space", raw.phase_space,
                 "coordinates of a path: directions or bidirectional (default: as render)")
      ->type_name("SPACE");
  app.add_option("-t,--threads", raw.threads, "threads; 0: all")
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--seed", raw.seed, "seed of the random numbers")
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--json", raw.json_file, "write all classes of paths as JSON")->type_name("FILE");
  app.add_option("--replay", raw.replay, "print all derivatives of one path, by its index")
      ->type_name("INDEX");
}

void declare_info(CLI::App& app, Raw& raw) {
  app.add_option("scene", raw.scene, "Mitsuba scene file (XML)")->type_name("SCENE");
  declare_scene_options(app, raw);
  app.add_flag("--integrators", raw.integrators, "list the integrators and their options");
}

void declare_diff(CLI::App& app, Raw& raw) {
  app.add_option("image", raw.image, "image")->required()->type_name("IMAGE");
  app.add_option("reference", raw.reference, "what it should be")
      ->required()
      ->type_name("REFERENCE");
  app.add_flag("--json", raw.json, "print JSON");
}

SceneArguments scene_arguments(const Raw& raw) {
  SceneArguments scene{.file = raw.scene, .defines = {}, .strict = raw.strict};
  for (const std::string& define : raw.defines) {
    const auto [name, value] = split_setting("-D", define);
    scene.defines.insert_or_assign(name, value);
  }
  return scene;
}

Work parse_work(const Raw& raw) {
  Work work;
  if (raw.time) work.time = parse_number("--time", *raw.time, 0.0);
  if (raw.mutations_per_pixel)
    work.mutations_per_pixel = parse_number("--mutations-per-pixel", *raw.mutations_per_pixel, 0.0);
  if (raw.samples_per_pixel)
    work.samples_per_pixel = parse_number("--spp", *raw.samples_per_pixel, 1);
  return work;
}

/// At most one of the three, and one that the integrator has.
void set_work(const Raw& raw, RenderCommand& command) {
  const int given =
      (raw.time ? 1 : 0) + (raw.mutations_per_pixel ? 1 : 0) + (raw.samples_per_pixel ? 1 : 0);
  if (given > 1) throw UsageError("give only one of --time, --mutations-per-pixel and --spp");
  const bool chains =
      command.integrator == Integrator::Pssmlt || command.integrator == Integrator::Mmlt ||
      command.integrator == Integrator::H2mc || command.integrator == Integrator::Lmc ||
      command.integrator == Integrator::Mala || command.integrator == Integrator::Mlt;
  if (raw.mutations_per_pixel && !chains && command.integrator != Integrator::Langevin)
    throw UsageError(fmt::format(
        "--mutations-per-pixel is for the langevin, pssmlt, mmlt, h2mc, lmc, mala and mlt "
        "integrators; {} takes --spp",
        raw.integrator));
  if (raw.samples_per_pixel && chains)
    throw UsageError(fmt::format("{} takes --mutations-per-pixel, not --spp", raw.integrator));
  command.work = parse_work(raw);
}

/// The file of a flag that belongs to one integrator: in a format with named channels, and not over
/// an image. None if the flag was not given.
std::optional<std::filesystem::path> layers_file(std::string_view flag, const std::string& text,
                                                 Integrator owner, const RenderCommand& command) {
  if (text.empty()) return std::nullopt;
  if (command.integrator != owner)
    throw UsageError(fmt::format("{} is for the {} integrator", flag, name_of(owner)));
  const std::filesystem::path file = text;
  if (file.extension() != ".exr" && file.extension() != ".EXR")
    throw UsageError(fmt::format("{} is '{}': must end in .exr", flag, text));
  if (std::find(command.outputs.begin(), command.outputs.end(), file) != command.outputs.end())
    throw UsageError(fmt::format("{} is '{}': the image goes there", flag, text));
  return file;
}

Integrator parse_integrator(const std::string& name) {
  for (const auto& [integrator, known] : kIntegrators)
    if (known == name) return integrator;
  std::vector<std::string_view> names;
  names.reserve(std::size(kIntegrators));
  for (const auto& known : kIntegrators) names.push_back(known.second);
  throw UsageError(
      fmt::format("unknown integrator '{}'; the integrators are {}", name, fmt::join(names, ", ")));
}

RenderCommand render_command(const Raw& raw) {
  RenderCommand command;
  command.scene = scene_arguments(raw);
  command.outputs.assign(raw.outputs.begin(), raw.outputs.end());
  if (command.outputs.empty()) command.outputs.emplace_back(command.scene.file.stem() += ".exr");
  command.integrator = parse_integrator(raw.integrator);
  for (const std::string& setting : raw.settings)
    command.settings.push_back(split_setting("--set", setting));
  set_work(raw, command);
  command.threads = parse_number("--threads", raw.threads, 0);
  command.seed = parse_number("--seed", raw.seed, std::uint64_t{0});
  if (!raw.statistics.empty()) command.statistics = raw.statistics;
  command.layers = layers_file("--layers", raw.layers, Integrator::Langevin, command);
  command.strategies = layers_file("--strategies", raw.strategies, Integrator::Bdpt, command);
  command.shares = layers_file("--shares", raw.shares, Integrator::Langevin, command);
  command.check_gradients = raw.check_gradients;
  if (command.check_gradients && command.integrator != Integrator::Langevin)
    throw UsageError("--check-gradients is for the langevin integrator");
  if (raw.verbose && raw.quiet) throw UsageError("give only one of -v and -q");
  if (raw.verbose) command.verbosity = Verbosity::Verbose;
  if (raw.quiet) command.verbosity = Verbosity::Quiet;
  return command;
}

/// The parts of `text` between separators: one more than there are of these.
std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::size_t start = 0;
  for (std::size_t end = 0; end != std::string::npos; start = end + 1) {
    end = text.find(separator, start);
    parts.push_back(text.substr(start, end - start));
  }
  return parts;
}

/// The settings after the first of the parts "NAME:OPTION=VALUE:.." of the argument of a flag.
Settings parse_settings(std::string_view flag, const std::vector<std::string>& parts) {
  Settings settings;
  for (std::size_t i = 1; i < parts.size(); ++i)
    settings.push_back(
        split_setting(fmt::format("the setting of {} in {}", parts[0], flag), parts[i]));
  return settings;
}

/// "langevin:mode=chain:scale=0.2"
IntegratorChoice parse_choice(const std::string& text) {
  const std::vector<std::string> parts = split(text, ':');
  return {.name = text,
          .integrator = parse_integrator(parts[0]),
          .settings = parse_settings("--integrators", parts)};
}

constexpr double kCompareSeconds = 10;
constexpr double kStudyMutations = 100;

/// Its integrators, at equal time and at equal mutations.
void set_study(const Raw& raw, CompareCommand& command) {
  const std::vector<std::string> parts = split(raw.study, ':');
  if (parts[0] != "terms")
    throw UsageError(fmt::format("unknown study '{}'; the study is terms", parts[0]));
  if (raw.samples_per_pixel)
    throw UsageError("--study takes --time and --mutations-per-pixel, not --spp");
  const Work given = parse_work(raw);
  Work equal_time;
  equal_time.time = given.time.value_or(kCompareSeconds);
  Work equal_mutations;
  equal_mutations.mutations_per_pixel = given.mutations_per_pixel.value_or(kStudyMutations);
  command.integrators = terms_of_the_step(parse_settings("--study", parts));
  command.budgets = {{"equal_time", equal_time}, {"equal_mutations", equal_mutations}};
}

CompareCommand compare_command(const Raw& raw) {
  CompareCommand command;
  command.scene = scene_arguments(raw);
  if (!raw.reference.empty()) command.reference = raw.reference;
  command.runs = parse_number("--runs", raw.runs, 2);
  command.threads = parse_number("--threads", raw.threads, 0);
  command.seed = parse_number("--seed", raw.seed, std::uint64_t{0});
  command.folder = raw.folder;
  if (raw.choices.empty() == raw.study.empty())
    throw UsageError("give either --integrators or --study");
  if (!raw.study.empty()) {
    set_study(raw, command);
    return command;
  }
  for (const std::string& text : split(raw.choices, ',')) {
    for (const IntegratorChoice& other : command.integrators)
      if (other.name == text) throw UsageError(fmt::format("--integrators names '{}' twice", text));
    command.integrators.push_back(parse_choice(text));
  }
  Work work = parse_work(raw);
  const bool by_work = work.mutations_per_pixel || work.samples_per_pixel;
  if (by_work && work.time)
    throw UsageError("give either --time, or --spp and --mutations-per-pixel");
  if (!by_work && !work.time) work.time = kCompareSeconds;
  command.budgets = {{"", work}};
  return command;
}

GradcheckCommand gradcheck_command(const Raw& raw) {
  GradcheckCommand command;
  command.scene = scene_arguments(raw);
  command.paths = parse_number("--paths", raw.paths, 1);
  command.threads = parse_number("--threads", raw.threads, 0);
  command.seed = parse_number("--seed", raw.seed, std::uint64_t{0});
  if (!raw.max_depth.empty()) {
    command.max_depth = parse_number("--max-depth", raw.max_depth, 1);
    if (*command.max_depth > kMaxPathLength)
      throw UsageError(fmt::format("--max-depth is '{}': must be an integer from 1 to {}",
                                   raw.max_depth, kMaxPathLength));
  }
  if (!raw.phase_space.empty()) {
    LangevinOptions options;
    set_option(entries(options), "phase_space", raw.phase_space);
    command.phase_space = options.phase_space;
  }
  if (!raw.json_file.empty()) command.json = raw.json_file;
  if (raw.replay) command.replay = parse_number("--replay", *raw.replay, std::uint64_t{0});
  if (command.json && command.replay) throw UsageError("give only one of --json and --replay");
  return command;
}

}  // namespace

std::string_view name_of(Integrator integrator) {
  return kIntegrators.at(static_cast<std::size_t>(integrator)).second;
}

Command parse_arguments(int argc, const char* const* argv) {
  Raw raw;
  CLI::App app("driftlight renders scenes by Langevin sampling of light paths.", "driftlight");
  app.set_version_flag("--version", "driftlight " DRIFTLIGHT_VERSION);
  app.require_subcommand(1);
  CLI::App& render = *app.add_subcommand("render", "render a scene");
  CLI::App& compare = *app.add_subcommand(
      "compare", "compare integrators over runs of the same time, with a page of the results");
  CLI::App& gradcheck = *app.add_subcommand(
      "gradcheck", "compare the derivatives of a scene's paths with independent ones");
  CLI::App& info = *app.add_subcommand("info", "what is in a scene, or the integrators");
  CLI::App& diff = *app.add_subcommand("diff", "compare an image with a reference");
  declare_render(render, raw);
  declare_compare(compare, raw);
  declare_gradcheck(gradcheck, raw);
  declare_info(info, raw);
  declare_diff(diff, raw);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::ostringstream text;
    if (app.exit(error, text, text) == 0) return PrintCommand{text.str()};
    throw UsageError(error.what());
  }
  if (render.parsed()) return render_command(raw);
  if (compare.parsed()) return compare_command(raw);
  if (gradcheck.parsed()) return gradcheck_command(raw);
  if (diff.parsed()) return DiffCommand{raw.image, raw.reference, raw.json};
  if (raw.integrators == !raw.scene.empty())
    throw UsageError("info takes either a scene or --integrators");
  if (raw.integrators) return IntegratorsCommand{};
  return InfoCommand{scene_arguments(raw)};
}

}  // namespace driftlight::cli
