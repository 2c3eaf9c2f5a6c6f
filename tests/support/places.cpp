// SPDX-License-Identifier: Apache-2.0
#include "support/places.h"

namespace driftlight::test {

std::string program() { return DRIFTLIGHT_PROGRAM; }

std::filesystem::path own_scene(const std::string& name) {
  return std::filesystem::path(DRIFTLIGHT_SOURCE_DIR) / "scenes" / (name + ".xml");
}

std::filesystem::path fuzz_corpus() {
  return std::filesystem::path(DRIFTLIGHT_SOURCE_DIR) / "fuzz" / "corpus";
}

std::filesystem::path shared_folder() {
  return std::filesystem::path(DRIFTLIGHT_SOURCE_DIR).parent_path() / "shared";
}

}  // namespace driftlight::test
