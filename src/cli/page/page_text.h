// SPDX-License-Identifier: Apache-2.0
/// The parts of the page of `driftlight compare`: the files of this folder, which the build makes
/// part of the program.
#pragma once

#include <string_view>

namespace driftlight::cli {

/// `{{style}}`, `{{script}}` and `{{data}}` stand for the other two and for the results.
extern const std::string_view kPageHTML;
extern const std::string_view kPageCSS;
extern const std::string_view kPageJS;

}  // namespace driftlight::cli
