// SPDX-License-Identifier: Apache-2.0
/// The scene of a command.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/report.h"
#include "driftlight/scene_file.h"

namespace driftlight::cli {

LoadedScene load(const SceneArguments& scene);

/// FNV-1a (64 bits) of the bytes of all files, one after the other. Throws RuntimeError if one of
/// them can no longer be read.
std::uint64_t hash_of(const std::vector<std::filesystem::path>& files);

/// What tells a scene from others, wherever it lies.
struct SceneIdentity {
  std::string file;  ///< without its folder
  std::string hash;  ///< of all its files, "fnv1a64:" and 16 hexadecimal digits
  std::map<std::string, std::string> defines;
};

SceneIdentity identity_of(const SceneArguments& scene, const LoadedScene& loaded);

/// Adds it to the metadata of an image and to the statistics.
void add_scene(const SceneIdentity& scene, std::map<std::string, std::string>& metadata,
               nlohmann::ordered_json& statistics);

}  // namespace driftlight::cli
