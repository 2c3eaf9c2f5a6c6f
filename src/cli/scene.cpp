// SPDX-License-Identifier: Apache-2.0
#include "cli/scene.h"

#include <fmt/format.h>

#include <array>
#include <fstream>

namespace driftlight::cli {

LoadedScene load(const SceneArguments& scene) {
  return load_scene(scene.file, {.defines = scene.defines, .strict = scene.strict});
}

std::uint64_t hash_of(const std::vector<std::filesystem::path>& files) {
  // Fowler, Noll and Vo; the constants are theirs.
  constexpr std::uint64_t kBasis = 0xcbf29ce484222325;
  constexpr std::uint64_t kPrime = 0x100000001b3;
  std::uint64_t hash = kBasis;
  std::array<char, 1U << 16U> bytes{};
  for (const std::filesystem::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream) throw RuntimeError(fmt::format("{} can no longer be read", file.string()));
    do {
      stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
      for (std::streamsize i = 0; i < stream.gcount(); ++i)
        hash = (hash ^ static_cast<unsigned char>(bytes.at(static_cast<std::size_t>(i)))) * kPrime;
    } while (stream);
  }
  return hash;
}

SceneIdentity identity_of(const SceneArguments& scene, const LoadedScene& loaded) {
  return {scene.file.filename().string(), fmt::format("fnv1a64:{:016x}", hash_of(loaded.files)),
          scene.defines};
}

void add_scene(const SceneIdentity& scene, std::map<std::string, std::string>& metadata,
               nlohmann::ordered_json& statistics) {
  std::vector<std::string> defines;
  for (const auto& [name, value] : scene.defines)
    defines.push_back(fmt::format("{}={}", name, value));
  metadata["driftlight:scene"] = scene.file;
  metadata["driftlight:scene_hash"] = scene.hash;
  metadata["driftlight:defines"] = fmt::format("{}", fmt::join(defines, " "));
  statistics["scene"] = {{"file", scene.file}, {"hash", scene.hash}, {"defines", scene.defines}};
}

}  // namespace driftlight::cli
