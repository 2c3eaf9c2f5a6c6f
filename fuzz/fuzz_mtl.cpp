// SPDX-License-Identifier: Apache-2.0
/// Materials of Wavefront OBJ files, by way of a scene that uses them.
#include <string_view>

#include "driftlight/error.h"
#include "driftlight/scene_file.h"
#include "input_file.h"

namespace {

void write(const char* name, std::string_view text) {
  driftlight::fuzz::input_file(name, reinterpret_cast<const std::uint8_t*>(text.data()),
                               text.size());
}

void write_scene() {
  write("mesh.obj",
        "mtllib materials.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
        "usemtl first\nf 1/1 2/2 3/3\nusemtl second\nf 1/1 3/3 2/2\n");
  write("scene.xml",
        R"(<scene version="0.6.0"><sensor type="perspective"><film type="hdrfilm"/></sensor>)"
        R"(<emitter type="constant"/><shape type="obj">)"
        R"(<string name="filename" value="mesh.obj"/></shape></scene>)");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool kWritten = (write_scene(), true);
  static_cast<void>(kWritten);
  const auto library = driftlight::fuzz::input_file("materials.mtl", data, size);
  try {
    driftlight::load_scene(library.parent_path() / "scene.xml");
  } catch (const driftlight::InputError&) {
    // A message for the user: what bad files are meant to end in.
  }
  return 0;
}
