// SPDX-License-Identifier: Apache-2.0
/// Checks the derivatives on paths drawn from a scene.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "driftlight/gradient_table.h"
#include "driftlight/path_sampler.h"
#include "driftlight/render.h"

namespace driftlight {

struct SceneCheckOptions {
  int paths = 20000;
  std::uint64_t seed = 0;
  /// Longest path, in edges.
  int max_depth = LangevinOptions{}.max_depth;
  /// Of the coordinates by which the derivatives are.
  PhaseSpace phase_space = LangevinOptions{}.phase_space;
  /// Threads of the machine; 0: all. The result does not depend on it.
  int threads = 0;
  /// Called now and then, from one thread at a time.
  std::function<void(const Progress&)> progress;
};

struct SceneCheck {
  GradientTable table;
  /// Light-carrying paths that could not be drawn in the attempts given to each.
  std::uint64_t not_found = 0;
  /// BSDFs, emitters and kinds of shapes of the scene that no path reached; black BSDFs carry no
  /// light and are left out.
  std::vector<std::string> not_reached;
};

/// Checks `options.paths` paths, drawn by the sampler of the large steps from its uniform table, so
/// that all lengths appear. Then as many again are drawn, of which those are checked that reach
/// what the first did not reach, or whose class is rare.
/// Throws InputError if no path of the scene carries light to the sensor.
SceneCheck check_scene(const Scene& scene, const SceneCheckOptions& options,
                       const DerivativeFunctions& functions = DerivativeFunctions());

/// Path `index` of `seed`: a function of the other arguments alone. None if no light is found.
std::optional<PathSampler::Sample> draw_light_path(
    const Scene& scene, int max_depth, std::uint64_t seed, std::uint64_t index,
    PhaseSpace phase_space = LangevinOptions{}.phase_space);

}  // namespace driftlight
