// SPDX-License-Identifier: Apache-2.0
/// The runs of a comparison: rendered one integrator after the other, round by round, so that a
/// drift of the machine's speed meets all alike.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/integrator.h"
#include "driftlight/error.h"
#include "driftlight/render.h"

namespace driftlight::cli {

/// One render of one integrator.
struct Run {
  std::uint64_t seed = 0;
  /// At half the budget, a quarter, .., from the earliest that had an image to the whole.
  std::vector<Snapshot> snapshots;
  /// Tile luminances (run_figures.h) of the means over equal parts of the budget, kParts of them;
  /// empty if a pass was longer than a part.
  std::vector<std::vector<double>> parts;
  nlohmann::ordered_json statistics;            ///< as `render --stats` writes them
  std::map<std::string, std::string> metadata;  ///< as `render` stores it in images
};

/// Equal parts of a run.
inline constexpr int kParts = 8;

/// One that is compared, with its runs.
struct Contender {
  IntegratorChoice choice;
  IntegratorOptions options;
  std::vector<Run> runs;

  /// Of the whole budget.
  const Image& final_image(std::size_t run) const { return runs[run].snapshots.back().image; }
};

/// Settings applied, before anything is rendered. Throws OptionError; UsageError unless the work is
/// just that which they have a use for.
std::vector<Contender> contenders_of(const std::vector<IntegratorChoice>& choices,
                                     const Work& work);

/// Fractions of the budget, rising: 1, 1/2, 1/4, .. to about a second, to 1/8 at least.
std::vector<double> moments_of(const Work& work);

/// There are not two complete rounds of runs.
class StoppedTooEarly : public RuntimeError {
 public:
  using RuntimeError::RuntimeError;
};

/// Renders all runs of the command. If `stop` turns true, the runs of the round under way are
/// dropped; throws StoppedTooEarly if fewer than two rounds are complete.
void render_runs(const Scene& scene, const CompareCommand& command, const Work& work,
                 const std::atomic<bool>& stop,
                 const std::function<void(const Progress&)>& progress,
                 std::vector<Contender>& contenders);

}  // namespace driftlight::cli
