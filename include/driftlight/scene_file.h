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
  /// Whether something that nobody uses, such as a misspelt property, is an error. Else it is a
  /// notice, as in Mitsuba.
  bool strict = false;
};

struct LoadedScene {
  Scene scene;
  /// Longest path in edges, from the file's integrator. None: not given or unbounded (-1).
  std::optional<int> max_depth;
  /// Samples per pixel, from the file's sampler. None: not given.
  std::optional<int> sample_count = {};
  /// Things the user should know, each "file:line:column: ..". Of two kinds the picture may depend:
  /// properties and attributes that nobody uses, which may be misspelt ones (none if strict), and
  /// an integrator that is not ours. Little else in it changes the picture from Mitsuba's by more
  /// than a blur of a pixel or the digits of a table: other models of the sky, normals that Mitsuba
  /// 3 would flip or dim, the opacity of glass in .mtl files, the channels of the image.
  std::vector<std::string> notices;
  /// Of an ldrfilm, for files of 8-bit values.
  ToneMapping tone_mapping = {};
  /// All files that were read, each once: the scene's own, then the others as they are named.
  std::vector<std::filesystem::path> files = {};
};

/// Loads a scene. Throws SceneError (a missing or malformed file, an unknown plugin, a property
/// that is not supported, a bad number, an unresolved or cyclic ref, a mesh that cannot be read, no
/// sensor, no emitter) whose message names the place, what is valid there and the line itself. What
/// is wrong with several elements of <scene> is in one message, from line to line.
LoadedScene load_scene(const std::filesystem::path& file, const LoadOptions& options = {});

}  // namespace driftlight
