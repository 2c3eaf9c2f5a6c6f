// SPDX-License-Identifier: Apache-2.0
/// Folders that appear complete or not at all.
#pragma once

#include <filesystem>

namespace driftlight {

/// A folder under a temporary name beside its target. `commit` gives it its name; without it the
/// folder is removed with all that is in it.
class PendingFolder {
 public:
  /// Makes the temporary folder. Throws RuntimeError.
  explicit PendingFolder(const std::filesystem::path& target);
  ~PendingFolder();
  PendingFolder(const PendingFolder&) = delete;
  PendingFolder& operator=(const PendingFolder&) = delete;

  /// Where to write.
  const std::filesystem::path& temporary() const { return temporary_; }
  /// Renames the folder, over an empty one that exists. Throws RuntimeError.
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
};

/// Throws InputError unless a folder can be made at `folder`: the one that it lies in must exist
/// and be writable, and what is there already must be an empty folder.
void check_folder_target(const std::filesystem::path& folder);

}  // namespace driftlight
