// SPDX-License-Identifier: Apache-2.0
/// What a render says about itself, for people, programs and the image file.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "driftlight/render.h"

namespace driftlight::cli {

struct Report {
  /// Goes into the image: nothing that depends on the machine, its speed or the time of day, so
  /// that the same seed and work give the same file.
  std::map<std::string, std::string> metadata;
  nlohmann::ordered_json statistics;
  std::vector<std::string> summary;   ///< lines
  std::vector<std::string> details;   ///< lines, for -v
  std::vector<std::string> warnings;  ///< of an image that is not to be trusted yet
  bool stopped = false;               ///< ended early
  bool empty = false;                 ///< ended before there was an image
  std::string failure;                ///< what went wrong, if anything did
};

/// `entries` are the options that were used, with their values.
Report make_report(const LangevinResult& result, const LangevinOptions& options,
                   const std::vector<OptionEntry>& entries, const RenderOptions& render);
/// Of chains in primary sample space.
Report make_report(const std::string& integrator, const LangevinResult& result,
                   const std::vector<OptionEntry>& entries, const RenderOptions& render);
Report make_report(const std::string& integrator, const PathResult& result,
                   const std::vector<OptionEntry>& entries, const RenderOptions& render);

}  // namespace driftlight::cli
