// SPDX-License-Identifier: Apache-2.0
#include "search_path.h"

#include <algorithm>
#include <system_error>

namespace driftlight {

std::filesystem::path SearchPath::find(const std::string& name,
                                       const std::filesystem::path& own) const {
  // Without an error_code, a name that is too long for the system would end the program.
  std::error_code ignored;
  if (std::filesystem::exists(own / name, ignored)) return own / name;
  const auto found = std::find_if(
      directories_.rbegin(), directories_.rend(),
      [&](const auto& directory) { return std::filesystem::exists(directory / name, ignored); });
  return (found != directories_.rend() ? *found : directories_.front()) / name;
}

}  // namespace driftlight
