// SPDX-License-Identifier: Apache-2.0
#include "cli/text_file.h"

#include <fmt/format.h>

#include <fstream>

#include "driftlight/error.h"
#include "pending_file.h"

namespace driftlight::cli {

void write_text(const std::filesystem::path& file, const std::string& text) {
  PendingFile pending(file);
  std::ofstream out(pending.temporary());
  out << text;
  out.close();
  if (!out) throw RuntimeError(fmt::format("cannot write '{}'", file.string()));
  pending.commit();
}

}  // namespace driftlight::cli
