// SPDX-License-Identifier: Apache-2.0
#include "pending_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <system_error>
#include <utility>

#include "driftlight/error.h"

namespace driftlight {

PendingFile::PendingFile(std::filesystem::path target)
    : target_(std::move(target)),
      temporary_(target_.parent_path() / fmt::format(".{}.{}.tmp{}", target_.stem().string(),
                                                     ::getpid(), target_.extension().string())) {}

PendingFile::~PendingFile() {
  std::error_code ignored;
  std::filesystem::remove(temporary_, ignored);
}

void PendingFile::commit() {
  std::error_code error;
  std::filesystem::rename(temporary_, target_, error);
  if (error)
    throw RuntimeError(fmt::format("cannot write '{}': {}", target_.string(), error.message()));
}

void check_target(const std::filesystem::path& file) {
  const auto fail = [&](std::string_view why) {
    throw InputError(fmt::format("cannot write '{}': {}", file.string(), why));
  };
  std::error_code ignored;
  const std::filesystem::path parent = file.parent_path();
  const std::filesystem::path folder = parent.empty() ? "." : parent;
  if (!std::filesystem::is_directory(folder, ignored))
    fail(fmt::format("there is no folder '{}'", folder.string()));
  if (file.filename().empty() || std::filesystem::is_directory(file, ignored))
    fail("it is a folder");
  if (::access(folder.c_str(), W_OK) != 0)
    fail(fmt::format("the folder '{}' is not writable", folder.string()));
}

}  // namespace driftlight
