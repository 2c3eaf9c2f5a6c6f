// SPDX-License-Identifier: Apache-2.0
/// The files that a scene is made of.
#pragma once

#include <filesystem>
#include <set>
#include <system_error>
#include <vector>

namespace driftlight {

/// Each once, in the order in which they were first asked for.
class FileList {
 public:
  /// Takes note of it if there is such a file.
  void add(const std::filesystem::path& file) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) return;
    const std::filesystem::path canonical = std::filesystem::canonical(file, error);
    if (!error && seen_.insert(canonical).second) files_.push_back(file);
  }

  const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  std::set<std::filesystem::path> seen_;  ///< as the system knows them
  std::vector<std::filesystem::path> files_;
};

}  // namespace driftlight
