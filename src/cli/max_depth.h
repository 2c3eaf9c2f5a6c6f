// SPDX-License-Identifier: Apache-2.0
/// The longest path of a render, from the scene or from the integrator's default.
#pragma once

#include <string>

#include "driftlight/path.h"
#include "driftlight/scene_file.h"

namespace driftlight::cli {

struct MaxDepth {
  int edges;
  std::string notice;  ///< empty if the scene's own number is used
};

inline MaxDepth max_depth(const LoadedScene& loaded, int default_edges) {
  if (!loaded.max_depth)
    return {default_edges,
            "the scene does not bound the length of paths: rendering those of up to " +
                std::to_string(default_edges) + " edges"};
  if (*loaded.max_depth > kMaxPathLength)
    return {kMaxPathLength,
            "the scene asks for paths of up to " + std::to_string(*loaded.max_depth) +
                " edges: rendering those of up to " + std::to_string(kMaxPathLength)};
  return {*loaded.max_depth, ""};
}

}  // namespace driftlight::cli
