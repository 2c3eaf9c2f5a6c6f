// SPDX-License-Identifier: Apache-2.0
/// Scene files.
#include "driftlight/error.h"
#include "driftlight/scene_file.h"
#include "input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    driftlight::load_scene(driftlight::fuzz::input_file("scene.xml", data, size));
  } catch (const driftlight::InputError&) {
    // A message for the user: what bad files are meant to end in.
  }
  return 0;
}
