// SPDX-License-Identifier: Apache-2.0
/// The figures of a comparison, for programs and people.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "cli/comparison.h"
#include "driftlight/image.h"

namespace driftlight::cli {

/// The reference, or without one the median image of all runs.
Image expected_image(const std::vector<Contender>& contenders,
                     const std::optional<Image>& reference);

/// All of results.json. Of several runs of one moment it gives medians, of spreads those over all
/// pairs of runs, relative to what is expected. What there is no reference, or no kernel, for is
/// null.
nlohmann::ordered_json comparison_results(const CompareCommand& command, const Work& work,
                                          const std::vector<Contender>& contenders,
                                          const std::optional<Image>& reference,
                                          const Image& expected);

/// A line for each integrator and moment, from what `comparison_results` gave.
std::string csv_text(const nlohmann::ordered_json& results);

/// A table of the last moment for the terminal, from what `comparison_results` gave.
std::string summary_text(const nlohmann::ordered_json& results);

/// The name of a contender's files, without their endings.
std::string file_stem(const IntegratorChoice& choice);

}  // namespace driftlight::cli
