// SPDX-License-Identifier: Apache-2.0
/// Files that appear complete or not at all.
#pragma once

#include <filesystem>

namespace driftlight {

/// A file under a temporary name beside its target, with the same ending. `commit` gives it its
/// name; without it the file is removed.
class PendingFile {
 public:
  explicit PendingFile(std::filesystem::path target);
  ~PendingFile();
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  const std::filesystem::path& target() const { return target_; }
  /// Where to write.
  const std::filesystem::path& temporary() const { return temporary_; }
  /// Renames the file, over one that exists. Throws RuntimeError.
  void commit();

 private:
  std::filesystem::path target_;
  std::filesystem::path temporary_;
};

/// Throws InputError unless a file can be made at `file`: its folder must exist and be writable,
/// and it must not be a folder itself.
void check_target(const std::filesystem::path& file);

}  // namespace driftlight
