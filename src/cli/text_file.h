// SPDX-License-Identifier: Apache-2.0
/// Text files that appear complete or not at all.
#pragma once

#include <filesystem>
#include <string>

namespace driftlight::cli {

/// Throws RuntimeError.
void write_text(const std::filesystem::path& file, const std::string& text);

}  // namespace driftlight::cli
