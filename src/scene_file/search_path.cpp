// SPDX-License-Identifier: Apache-2.0
#include "search_path.h"

#include <ranges>
#include <system_error>

namespace driftlight {

std::filesystem::path SearchPath::find(const std::string& name,
                                       const std::filesystem::path& own) const {
  // Without an error_code, a name that is too long for the system would end the program.
  std::error_code ignored;
  if (std::filesystem::exists(own / name, ignored)) return own / name;
  for (const std::filesystem::path& directory : directories_ | std::views::reverse)
    if (std::filesystem::exists(directory / name, ignored)) return directory / name;
  return directories_.front() / name;
}

}  // namespace driftlight
