// SPDX-License-Identifier: Apache-2.0
/// PLY files.
#include "driftlight/error.h"
#include "input_file.h"
#include "scene_file/mesh_ply.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    driftlight::read_ply(driftlight::fuzz::input_file("mesh.ply", data, size));
  } catch (const driftlight::InputError&) {
    // A message for the user: what bad files are meant to end in.
  }
  return 0;
}
