// SPDX-License-Identifier: Apache-2.0
/// Wavefront OBJ files.
#include "driftlight/error.h"
#include "input_file.h"
#include "scene_file/mesh_obj.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    driftlight::read_obj(driftlight::fuzz::input_file("mesh.obj", data, size), {});
  } catch (const driftlight::InputError&) {
    // A message for the user: what bad files are meant to end in.
  }
  return 0;
}
