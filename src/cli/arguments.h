// SPDX-License-Identifier: Apache-2.0
/// The command line, parsed and checked.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "driftlight/error.h"

namespace driftlight::cli {

/// Flags that do not go together or values they cannot take. Exit code 2.
class UsageError : public InputError {
 public:
  using InputError::InputError;
};

enum class Integrator { Langevin, Path };
enum class Verbosity { Quiet, Normal, Verbose };

struct SceneArguments {
  std::filesystem::path file;
  std::map<std::string, std::string> defines;
};

/// driftlight render
struct RenderCommand {
  SceneArguments scene;
  std::vector<std::filesystem::path> outputs;  ///< at least one
  Integrator integrator = Integrator::Langevin;
  std::vector<std::pair<std::string, std::string>> settings;
  std::optional<double> time;
  double mutations_per_pixel = 100;
  int samples_per_pixel = 64;
  int threads = 0;
  std::uint64_t seed = 0;
  std::optional<std::filesystem::path> statistics;
  std::optional<std::filesystem::path> layers;  ///< ends in .exr
  Verbosity verbosity = Verbosity::Normal;
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

using Command =
    std::variant<RenderCommand, InfoCommand, IntegratorsCommand, DiffCommand, PrintCommand>;

/// Throws UsageError.
Command parse_arguments(int argc, const char* const* argv);

}  // namespace driftlight::cli
