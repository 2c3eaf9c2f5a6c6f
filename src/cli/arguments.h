// SPDX-License-Identifier: Apache-2.0
/// The command line, parsed and checked.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "driftlight/error.h"
#include "driftlight/options.h"

namespace driftlight::cli {

/// Flags that do not go together or values they cannot take. Exit code 2.
class UsageError : public InputError {
 public:
  using InputError::InputError;
};

enum class Integrator { Langevin, Pssmlt, Mmlt, H2mc, Lmc, Mala, Mlt, Erpt, Path, Bdpt, Light };
enum class Verbosity { Quiet, Normal, Verbose };

struct SceneArguments {
  std::filesystem::path file;
  std::map<std::string, std::string> defines;
  bool strict = false;  ///< what is not used of the file is an error
};

/// Options of an integrator by name, with their values.
using Settings = std::vector<std::pair<std::string, std::string>>;

/// How long to render. Of the last two, the one that counts the integrator's work is used if no
/// time is given.
struct Work {
  std::optional<double> time;  ///< seconds
  std::optional<double> mutations_per_pixel;
  std::optional<int> samples_per_pixel;
};

/// driftlight render
struct RenderCommand {
  SceneArguments scene;
  std::vector<std::filesystem::path> outputs;  ///< at least one
  Integrator integrator = Integrator::Langevin;
  Settings settings;
  Work work;
  int threads = 0;
  std::uint64_t seed = 0;
  std::optional<std::filesystem::path> statistics;
  std::optional<std::filesystem::path> layers;      ///< ends in .exr
  std::optional<std::filesystem::path> strategies;  ///< ends in .exr
  std::optional<std::filesystem::path> shares;      ///< ends in .exr
  bool check_gradients = false;
  Verbosity verbosity = Verbosity::Normal;
};

/// An integrator with settings, as `compare` takes it: NAME[:OPTION=VALUE]...
struct IntegratorChoice {
  std::string name;  ///< as it was written, or for a study made up
  Integrator integrator = Integrator::Langevin;
  Settings settings;
};

/// What all runs of a comparison are given.
struct Budget {
  std::string folder;  ///< of its results, within that of the command; empty: that one itself
  Work work;
};

/// driftlight compare
struct CompareCommand {
  SceneArguments scene;
  std::optional<std::filesystem::path> reference;
  std::vector<IntegratorChoice> integrators;  ///< at least one, no two of the same name
  /// One; of the study of terms two, equal time and equal mutations.
  std::vector<Budget> budgets;
  int runs = 3;  ///< of each integrator, at least two
  int threads = 0;
  std::uint64_t seed = 0;
  std::filesystem::path folder;
};

/// driftlight gradcheck
struct GradcheckCommand {
  SceneArguments scene;
  int paths = 20000;
  std::uint64_t seed = 0;
  std::optional<int> max_depth;
  PhaseSpace phase_space = LangevinOptions{}.phase_space;
  int threads = 0;
  std::optional<std::filesystem::path> json;
  std::optional<std::uint64_t> replay;  ///< index of one path, instead of all
};

/// driftlight info SCENE
struct InfoCommand {
  SceneArguments scene;
};

/// driftlight info --integrators
struct IntegratorsCommand {};

/// driftlight diff
struct DiffCommand {
  std::filesystem::path image;
  std::filesystem::path reference;
  bool json = false;
};

/// --help and --version: the text that was asked for.
struct PrintCommand {
  std::string text;
};

using Command = std::variant<RenderCommand, CompareCommand, GradcheckCommand, InfoCommand,
                             IntegratorsCommand, DiffCommand, PrintCommand>;

/// As users write it.
std::string_view name_of(Integrator integrator);

/// Throws UsageError.
Command parse_arguments(int argc, const char* const* argv);

}  // namespace driftlight::cli
