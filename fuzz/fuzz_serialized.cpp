// SPDX-License-Identifier: Apache-2.0
/// Meshes of .serialized files: the second, which needs the table of offsets, and the first.
#include "driftlight/error.h"
#include "input_file.h"
#include "scene_file/mesh_serialized.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const auto file = driftlight::fuzz::input_file("mesh.serialized", data, size);
    driftlight::read_serialized(file, 0);
    driftlight::read_serialized(file, 1);
  } catch (const driftlight::InputError&) {
    // A message for the user: what bad files are meant to end in.
  }
  return 0;
}
