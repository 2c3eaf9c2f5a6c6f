// SPDX-License-Identifier: Apache-2.0
/// Where the project's own files are.
#pragma once

#include <filesystem>
#include <string>

namespace driftlight::test {

/// The program driftlight.
std::string program();
/// scenes/NAME.xml
std::filesystem::path own_scene(const std::string& name);
/// Seeds of the fuzzers, a folder for each.
std::filesystem::path fuzz_corpus();
/// Scenes and images by others, beside the project; there need not be any.
std::filesystem::path shared_folder();

}  // namespace driftlight::test
