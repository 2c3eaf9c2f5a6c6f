// SPDX-License-Identifier: Apache-2.0
/// Images of independent runs compared tile by tile.
#pragma once

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "driftlight/image.h"
#include "driftlight/scene_file.h"
#include "support/t_test.h"

namespace driftlight::test {

inline constexpr int kRuns = 20;

/// An own scene at 32 x 24 pixels.
LoadedScene load_small(const std::string& name,
                       const std::map<std::string, std::string>& defines = {});

/// Rough metal and white balls under a spot and parallel light.
Scene limelight();

/// Mean luminance of each tile of 8 x 8 pixels.
std::vector<double> tile_means(const Image& image);

/// Tile means over kRuns independent runs; render(seed) is one run.
template <class Render>
std::vector<Moments> tiles_over_runs(const Render& render) {
  std::vector<Moments> tiles;
  for (int run = 0; run < kRuns; ++run) {
    const std::vector<double> means = tile_means(render(static_cast<std::uint64_t>(run)));
    tiles.resize(means.size());
    for (std::size_t i = 0; i < means.size(); ++i) tiles[i].add(means[i]);
  }
  return tiles;
}

/// Expects that the means agree in each tile: Welch's test, Sidak-corrected at 1 %; and that the
/// median over tiles of the standard error of the difference, relative, is below `resolution`: a
/// test that cannot see a bias of three times this much would prove nothing.
void expect_equal_tiles(const std::string& name, const std::vector<Moments>& tiles,
                        const std::vector<Moments>& reference, double resolution);

}  // namespace driftlight::test
