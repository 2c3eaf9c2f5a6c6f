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

TEST(FuzzCorpus, OfPlyFiles) {
  EXPECT_GE(read_corpus("ply", [](const auto& file) { read_ply(file); }), 3);
}

TEST(FuzzCorpus, OfSerializedFiles) {
  EXPECT_GE(read_corpus("serialized",
                        [](const auto& file) {
                          read_serialized(file, 0);
                          read_serialized(file, 1);
                        }),
            2);
}

}  // namespace
}  // namespace driftlight
