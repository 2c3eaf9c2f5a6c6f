// SPDX-License-Identifier: Apache-2.0
/// Mitsuba scene files (XML): the dialects of Mitsuba 0.5 and 0.6, and of Mitsuba 3.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "driftlight/error.h"
#include "driftlight/scene.h"
#include "driftlight/tone_mapping.h"

namespace driftlight {

struct LoadOptions {
  /// Values for $name in the file; they win over <default>.
  std::map<std::string, std::string> defines;
};

struct LoadedScene {
  Scene scene;
  /// Longest path in edges, from the file's integrator. None: not given or unbounded (-1).
  std::optional<int> max_depth;
  /// Things the user should know, each "file:line:column: ..": an integrator that is not ours, a
  /// sampler that is not used, a filter that is replaced, and so on. Few change the picture by more
  /// than a blur of a pixel or the digits of a table: other models of the sky, normals that Mitsuba
  /// 3 would flip or dim, the opacity of glass in .mtl files, the channels of the image.
  std::vector<std::string> notices;
  /// Of an ldrfilm, for files of 8-bit values.
  ToneMapping tone_mapping = {};
};

/// Loads a scene. Throws SceneError (a missing or malformed file, an unknown plugin or property, a
/// bad number, an unresolved or cyclic ref, a mesh that cannot be read, no sensor, no emitter).
LoadedScene load_scene(const std::filesystem::path& file, const LoadOptions& options = {});

}  // namespace driftlight
