// SPDX-License-Identifier: Apache-2.0
/// Scenes of one class of lobes each, with paths of every length.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "driftlight/linearization.h"
#include "driftlight/scene.h"

namespace driftlight::bench {

inline constexpr int kMinLength = 2;
inline constexpr int kMaxLength = 12;

/// A path with its chart and derivatives.
struct PathState {
  PathTopology topology;
  PathCoordinates coordinates;
  Chart chart;
  Linearization linearization;
};

struct PathClass {
  std::string name;
  Scene scene;
  /// By length in edges; the same number for each length.
  std::array<std::vector<PathState>, kMaxLength + 1> paths;
};

/// All classes, built on first use. Every path of n edges has n - 1 scattering vertices, in a
/// closed room with one lamp:
///   diffuse      all diffuse, the last one connected to the lamp (2 n coordinates)
///   glossy       all rough metal (GGX), the lamp is hit (2 n)
///   rough_glass  all rough glass, reflected or refracted, inside a block with bubbles (2 n)
///   delta        smooth mirrors and glass but for one diffuse vertex (4)
const std::vector<PathClass>& path_classes();

}  // namespace driftlight::bench
