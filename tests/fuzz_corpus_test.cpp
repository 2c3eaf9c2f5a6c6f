// SPDX-License-Identifier: Apache-2.0
/// The seeds of the fuzzers are good files; whatever else is in their corpus once did harm, and is
/// read or refused.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "driftlight/error.h"
#include "driftlight/scene_file.h"
#include "scene_file/mesh_obj.h"
#include "scene_file/mesh_ply.h"
#include "scene_file/mesh_serialized.h"
#include "support/places.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using Reader = std::function<void(const std::filesystem::path&)>;

/// Reads all files of a corpus; returns how many of them are good.
int read_corpus(const std::string& name, const Reader& read) {
  int good = 0;
  for (const auto& entry : std::filesystem::directory_iterator(test::fuzz_corpus() / name)) {
    try {
      read(entry.path());
      ++good;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()), "") << entry.path();
    }
  }
  return good;
}

TEST(FuzzCorpus, OfScenes) {
  EXPECT_GE(read_corpus("scene", [](const auto& file) { load_scene(file); }), 2);
}

TEST(FuzzCorpus, OfObjFiles) {
  EXPECT_GE(read_corpus("obj", [](const auto& file) { read_obj(file, {.one_mesh = false}); }), 1);
}

TEST(FuzzCorpus, OfMaterials) {
  const test::SceneDirectory directory;
  directory.write("mesh.obj",
                  "mtllib materials.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
                  "usemtl first\nf 1/1 2/2 3/3\nusemtl third\nf 1/1 3/3 2/2\n");
  const std::string scene =
      test::lit(R"(<shape type="obj"><string name="filename" value="mesh.obj"/></shape>)");
  const auto read = [&](const std::filesystem::path& file) {
    std::filesystem::copy_file(file, directory.path() / "materials.mtl",
                               std::filesystem::copy_options::overwrite_existing);
    directory.load(scene);
  };
  EXPECT_GE(read_corpus("mtl", read), 1);
}

TEST(FuzzCorpus, OfPlyFiles) {
  EXPECT_GE(read_corpus("ply", [](const auto& file) { read_ply(file); }), 3);
}

TEST(FuzzCorpus, OfSerializedFiles) {
  EXPECT_GE(read_corpus("serialized",
                        [](const auto& file) {
                          read_serialized(file, 0);
                          read_serialized(file, 1);
                        }),
            3);
}

}  // namespace
}  // namespace driftlight
