// SPDX-License-Identifier: Apache-2.0
/// Gradient tables for people and programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "driftlight/gradient_table.h"

namespace driftlight::cli {

/// Medians and maxima of the relative errors by feature of the paths, then what was compared.
std::string table_text(const GradientTable& table);

/// One line: how many paths, and the largest errors.
std::string summary_line(const GradientTable& table);

/// All of the table, full classes included.
nlohmann::ordered_json to_json(const GradientTable& table);

/// What is wrong, in one sentence without its full stop.
std::string describe(const GradientFailure& failure);

/// "gradient, jets against hand", ..
std::string title(Quantity quantity);

}  // namespace driftlight::cli
