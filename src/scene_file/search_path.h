// SPDX-License-Identifier: Apache-2.0
/// Where the files are that a scene names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace driftlight {

/// The directories in which files are looked for.
class SearchPath {
 public:
  /// `main` is that of the main scene file.
  explicit SearchPath(std::filesystem::path main) : directories_{std::move(main)} {}

  /// A directory of <path>, which wins over all before it.
  void add(std::filesystem::path directory) { directories_.push_back(std::move(directory)); }

  /// The file in the first directory that has it: `own`, that of the file which names it, then
  /// those of <path>, then the main one. If none has it, where it would be in the main one.
  std::filesystem::path find(const std::string& name, const std::filesystem::path& own) const;

 private:
  std::vector<std::filesystem::path> directories_;
};

}  // namespace driftlight
