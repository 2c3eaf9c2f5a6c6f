// SPDX-License-Identifier: Apache-2.0
/// `driftlight render --strategies` as users meet it.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "support/places.h"
#include "support/process.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

/// Runs `driftlight render scene.xml` in a folder of its own.
class StrategiesCli : public ::testing::Test {
 protected:
  StrategiesCli() {
    std::filesystem::create_directory(folder());
    std::ofstream(folder() / "scene.xml")
        << test::lit(R"(<shape type="sphere"><point name="center" x="0" y="0" z="4"/></shape>)");
  }

  std::filesystem::path folder() const { return directory_.path() / "work"; }

  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder()))
      names.insert(entry.path().filename().string());
    return names;
  }
  std::string read(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(folder() / name, std::ios::binary).rdbuf();
    return text.str();
  }

  struct Outcome {
    int exit_code;
    std::string out;
    std::string err;
  };
  Outcome render(const std::vector<std::string>& arguments) const {
    std::vector<std::string> command{test::program(), "render", "scene.xml"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    test::Process process(command, folder(), directory_.path());
    const int exit_code = process.exit_code();
    return {exit_code, process.standard_output(), process.standard_error()};
  }

 private:
  test::SceneDirectory directory_;
};

TEST_F(StrategiesCli, WritesNamedChannelsAndTheSameImage) {
  const std::vector<std::string> work{"--integrator", "bdpt", "--spp", "2",
                                      "--seed",       "3",    "--set", "max_depth=2"};
  std::vector<std::string> with{"-o", "with.exr", "--strategies", "strategies.exr"};
  with.insert(with.end(), work.begin(), work.end());
  std::vector<std::string> without{"-o", "without.exr"};
  without.insert(without.end(), work.begin(), work.end());
  const Outcome outcome = render(with);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("bdpt: "), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("wrote strategies.exr"), std::string::npos) << outcome.out;
  ASSERT_EQ(render(without).exit_code, 0);
  EXPECT_TRUE(read("with.exr") == read("without.exr"));

  const auto input = OIIO::ImageInput::open((folder() / "strategies.exr").string());
  ASSERT_TRUE(input);
  const OIIO::ImageSpec& spec = input->spec();
  EXPECT_EQ(spec.width, 200);
  EXPECT_EQ(spec.height, 100);
  std::set<std::string> expected;
  for (const char* strategy : {"s0t2", "s2t1", "s1t2", "s0t3"})
    for (const char* channel : {".R", ".G", ".B"}) expected.insert(std::string(strategy) + channel);
  EXPECT_EQ(std::set<std::string>(spec.channelnames.begin(), spec.channelnames.end()), expected);
  EXPECT_EQ(spec.get_string_attribute("driftlight:integrator"), "bdpt");
}

TEST_F(StrategiesCli, MistakesAreNamedBeforeAnythingIsRendered) {
  struct Mistake {
    std::vector<std::string> arguments;
    std::vector<std::string> fragments;  ///< of the message
  };
  const std::vector<Mistake> mistakes{
      {{"--strategies", "s.exr"}, {"--strategies", "bdpt"}},
      {{"--strategies", "s.exr", "--integrator", "light"}, {"--strategies", "bdpt"}},
      {{"--strategies", "s.png", "--integrator", "bdpt"}, {"--strategies", "'s.png'", ".exr"}},
      {{"--strategies", "nowhere/s.exr", "--integrator", "bdpt"}, {"nowhere"}},
      {{"--strategies", "a.exr", "-o", "a.exr", "--integrator", "bdpt"},
       {"--strategies", "'a.exr'"}},
      {{"--integrator", "bdpt", "--set", "heuristic=maximum"},
       {"heuristic", "'maximum'", "balance|power"}},
      {{"--integrator", "light", "--set", "heuristic=power"}, {"'heuristic'", "max_depth"}},
  };
  const std::set<std::string> before = files();
  for (const Mistake& mistake : mistakes) {
    std::vector<std::string> arguments = mistake.arguments;
    // It would take an hour to render.
    arguments.insert(arguments.begin(), {"--time", "3600"});
    const Outcome outcome = render(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(outcome.err.rfind("driftlight: error: ", 0), 0U) << outcome.err;
    for (const std::string& fragment : mistake.fragments)
      EXPECT_NE(outcome.err.find(fragment), std::string::npos) << outcome.err;
    EXPECT_EQ(files(), before);
  }
}

}  // namespace
}  // namespace driftlight
