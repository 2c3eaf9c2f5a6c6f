// SPDX-License-Identifier: Apache-2.0
#include "pending_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <string_view>
#include <system_error>

#include "driftlight/error.h"

namespace driftlight {
namespace {

/// Without the slash that may stand at its end.
std::filesystem::path without_slash(const std::filesystem::path& folder) {
  const std::filesystem::path normal = folder.lexically_normal();
  return normal.filename().empty() ? normal.parent_path() : normal;
}

}  // namespace

PendingFolder::PendingFolder(const std::filesystem::path& target)
    : target_(without_slash(target)),
      temporary_(target_.parent_path() /
                 fmt::format(".{}.{}.tmp", target_.filename().string(), ::getpid())) {
  std::error_code error;
  std::filesystem::create_directory(temporary_, error);
  if (error)
    throw RuntimeError(
        fmt::format("cannot make the folder '{}': {}", temporary_.string(), error.message()));
}

PendingFolder::~PendingFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(temporary_, ignored);
}

void PendingFolder::commit() {
  std::error_code error;
  std::filesystem::rename(temporary_, target_, error);
  if (error)
    throw RuntimeError(fmt::format("cannot write '{}': {}", target_.string(), error.message()));
}

void check_folder_target(const std::filesystem::path& folder) {
  const auto fail = [&](std::string_view why) {
    throw InputError(fmt::format("cannot write '{}': {}", folder.string(), why));
  };
  std::error_code ignored;
  const std::filesystem::path target = without_slash(folder);
  const std::filesystem::path parent = target.parent_path().empty() ? "." : target.parent_path();
  if (!std::filesystem::is_directory(parent, ignored))
    fail(fmt::format("there is no folder '{}'", parent.string()));
  if (::access(parent.c_str(), W_OK) != 0)
    fail(fmt::format("the folder '{}' is not writable", parent.string()));
  if (!std::filesystem::exists(std::filesystem::symlink_status(target, ignored))) return;
  if (!std::filesystem::is_directory(std::filesystem::symlink_status(target, ignored)))
    fail("it is there already, and no folder");
  if (!std::filesystem::is_empty(target, ignored)) fail("the folder is there already, not empty");
}

}  // namespace driftlight
