// SPDX-License-Identifier: Apache-2.0
/// `driftlight gradcheck` and `driftlight render --check-gradients` as users meet them.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "support/places.h"
#include "support/process.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

/// A glossy sphere on a floor under a lamp, and a black shape that no light reaches.
const std::string kScene = R"(<scene version="0.6.0">
  <integrator type="path"><integer name="maxDepth" value="4"/></integrator>
  <default name="alpha" value="0.2"/>
  <sensor type="perspective">
    <float name="fov" value="50"/>
    <transform name="toWorld"><lookat origin="0,1,-5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="24"/><integer name="height" value="16"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <shape type="rectangle">
    <transform name="toWorld">
      <scale x="4" y="4"/><rotate x="1" angle="-90"/><translate y="-1"/>
    </transform>
    <bsdf type="diffuse"><spectrum name="reflectance" value="0.5"/></bsdf>
  </shape>
  <shape type="sphere">
    <bsdf type="roughconductor">
      <string name="distribution" value="ggx"/><float name="alpha" value="$alpha"/>
      <rgb name="eta" value="0.2, 0.9, 1.1"/><rgb name="k" value="3.9, 2.5, 2.2"/>
    </bsdf>
  </shape>
  <shape type="rectangle">
    <transform name="toWorld"><rotate x="1" angle="90"/><translate y="3"/></transform>
    <emitter type="area"><rgb name="radiance" value="4, 5, 6"/></emitter>
  </shape>
  <shape type="sphere">
    <point name="center" x="0" y="0" z="-40"/>
    <bsdf type="phong"/>
  </shape>
</scene>
)";

/// Cylinders of several kinds under one that emits, on a floor with a pattern.
const std::string kPipes = R"(<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="5"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="45"/>
    <transform name="to_world"><lookat origin="0,2,6" target="0,0.9,0" up="0,1,0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="24"/><integer name="height" value="16"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <shape type="rectangle">
    <transform name="to_world"><scale value="5"/><rotate x="1" angle="-90"/></transform>
    <bsdf type="diffuse"><texture type="checkerboard" name="reflectance"/></bsdf>
  </shape>
  <shape type="cylinder">
    <point name="p0" value="-1.5, 0, 0"/><point name="p1" value="-1.2, 2, 0"/>
    <float name="radius" value="0.5"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf>
  </shape>
  <shape type="cylinder">
    <point name="p0" value="-0.3, 0.5, 1"/><point name="p1" value="1.5, 0.5, 0.3"/>
    <float name="radius" value="0.4"/><bsdf type="roughconductor"/>
  </shape>
  <shape type="cylinder">
    <point name="p0" value="1.6, 0, 0.9"/><point name="p1" value="1.6, 1.5, 0.9"/>
    <float name="radius" value="0.35"/><bsdf type="dielectric"/>
  </shape>
  <shape type="cylinder">
    <point name="p0" value="-1.5, 2.8, 0"/><point name="p1" value="1.8, 3, 0"/>
    <float name="radius" value="0.2"/>
    <emitter type="area"><rgb name="radiance" value="8, 7, 6"/></emitter>
  </shape>
</scene>
)";

struct Outcome {
  int exit_code;
  std::string out;
  std::string err;
};

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Runs the program in a folder of its own that holds scene.xml.
class GradcheckCli : public ::testing::Test {
 protected:
  GradcheckCli() {
    std::filesystem::create_directory(folder());
    write("scene.xml", kScene);
  }

  std::filesystem::path folder() const { return directory_.path() / "work"; }

  void write(const std::string& name, const std::string& content) const {
    std::ofstream(folder() / name, std::ios::binary) << content;
  }
  std::string read(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(folder() / name, std::ios::binary).rdbuf();
    return text.str();
  }
  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder()))
      names.insert(entry.path().filename().string());
    return names;
  }

  Outcome run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), test::program());
    test::Process process(arguments, folder(), directory_.path());
    const int exit_code = process.exit_code();
    return {exit_code, process.standard_output(), process.standard_error()};
  }
  Outcome gradcheck(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "gradcheck");
    return run(std::move(arguments));
  }

 private:
  test::SceneDirectory directory_;
};

// Law: the derivatives of cylinders agree with independent ones, also where they emit.
TEST_F(GradcheckCli, CylindersPass) {
  write("pipes.xml", kPipes);
  const Outcome outcome = run({"gradcheck", "pipes.xml", "--paths", "2000"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  for (const char* const found : {"hit cylinder", "on cylinder", "dielectric transmission inside"})
    EXPECT_TRUE(contains(outcome.out, found)) << found;
}

TEST_F(GradcheckCli, PrintsATableAndWritesJson) {
  const Outcome outcome = gradcheck({"scene.xml", "--paths", "300", "--json", "check.json"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* part :
       {"diffuse", "rough conductor ggx", "on sphere", "length 2", "hit planar mesh",
        "gradient, jets against Ridders", "divergence, against exact", "tolerance", "undecided",
        "wrote check.json", "not reached: bsdf 3 (phong)"})
    EXPECT_TRUE(contains(outcome.out, part)) << part << " in\n" << outcome.out;
  EXPECT_EQ(files(), (std::set<std::string>{"check.json", "scene.xml"}));

  const auto json = nlohmann::json::parse(read("check.json"));
  EXPECT_EQ(json.at("scene"), "scene.xml");
  EXPECT_EQ(json.at("seed"), 0);
  EXPECT_EQ(json.at("max_depth"), 4);
  EXPECT_EQ(json.at("passed"), true);
  EXPECT_TRUE(json.at("failures").empty());
  EXPECT_EQ(json.at("not_found"), 0);
  EXPECT_EQ(json.at("not_reached").size(), 1U);
  EXPECT_GE(json.at("all").at("paths").get<int>(), 300);
  int paths = 0;
  for (const auto& [name, record] : json.at("classes").items()) {
    EXPECT_EQ(name.rfind("length ", 0), 0U) << name;
    paths += record.at("paths").get<int>();
  }
  EXPECT_EQ(paths, json.at("all").at("paths"));
  for (const char* quantity :
       {"gradient_hand", "gradient_ridders", "jacobian_hand", "jacobian_ridders", "divergence"}) {
    const double tolerance = json.at("tolerances").at(quantity).get<double>();
    for (const auto& [name, record] : json.at("features").items()) {
      const auto& r = record.at(quantity);
      EXPECT_LE(r.at("median").get<double>(), r.at("maximum").get<double>()) << name;
      EXPECT_LE(r.at("maximum").get<double>(), tolerance) << name << " " << quantity;
      EXPECT_GT(r.at("compared").get<int>(), 0) << name << " " << quantity;
      for (const char* count : {"paths", "kinks", "undecided", "worst"})
        EXPECT_GE(r.at(count).get<int>(), 0);
    }
  }
}

TEST_F(GradcheckCli, TheSameSeedGivesTheSameTableOnAnyNumberOfThreads) {
  const auto table = [&](const char* threads, const char* seed) {
    const Outcome outcome = gradcheck(
        {"scene.xml", "--paths", "200", "-t", threads, "--seed", seed, "--json", "check.json"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    auto json = nlohmann::json::parse(read("check.json"));
    json.erase("seconds");
    return json;
  };
  const auto one = table("1", "4");
  EXPECT_EQ(one, table("2", "4"));
  EXPECT_NE(one, table("2", "5"));
}

TEST_F(GradcheckCli, ReplaysThePathOfAnIndex) {
  ASSERT_EQ(gradcheck({"scene.xml", "--paths", "100", "--seed", "9", "--max-depth", "3", "--json",
                       "check.json"})
                .exit_code,
            0);
  const auto json = nlohmann::json::parse(read("check.json"));
  EXPECT_EQ(json.at("max_depth"), 3);
  for (const auto& [name, record] : json.at("classes").items()) {
    const std::string index = std::to_string(record.at("worst").get<int>());
    const Outcome outcome =
        gradcheck({"scene.xml", "--seed", "9", "--max-depth", "3", "--replay", index});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    for (const std::string& part :
         {"path " + index + " of seed 9", name, std::string("vertices"), std::string("coordinates"),
          std::string("direction"), std::string("grad U"), std::string("Q_jj"),
          std::string("sqrt(w)/3 dr"), std::string("div Q^-1"), std::string("agrees")})
      EXPECT_TRUE(contains(outcome.out, part)) << part << " in\n" << outcome.out;
    EXPECT_EQ(outcome.out, gradcheck({"scene.xml", "--seed", "9", "--max-depth", "3", "--replay",
                                      index, "-t", "1"})
                               .out);
  }
}

TEST_F(GradcheckCli, MistakesAreNamed) {
  struct Mistake {
    std::vector<std::string> arguments;
    std::vector<std::string> fragments;
  };
  const std::vector<Mistake> mistakes{
      {{}, {"scene"}},
      {{"missing.xml"}, {"missing.xml"}},
      {{"scene.xml", "-D", "alpha"}, {"-D", "name=value"}},
      {{"scene.xml", "-D", "alpha=rough"}, {"scene.xml:", "rough"}},
      {{"scene.xml", "--paths", "0"}, {"--paths", "'0'", "from 1"}},
      {{"scene.xml", "--paths", "many"}, {"--paths", "'many'"}},
      {{"scene.xml", "--seed", "-1"}, {"--seed", "'-1'"}},
      {{"scene.xml", "--threads", "-1"}, {"--threads", "'-1'"}},
      {{"scene.xml", "--max-depth", "17"}, {"--max-depth", "'17'", "16"}},
      {{"scene.xml", "--max-depth", "0"}, {"--max-depth", "'0'"}},
      {{"scene.xml", "--json", "nowhere/check.json"}, {"nowhere"}},
      {{"scene.xml", "--replay", "worst"}, {"--replay", "'worst'", "integer"}},
      {{"scene.xml", "--replay", "-3"}, {"--replay", "'-3'"}},
      {{"scene.xml", "--replay", "1", "--json", "check.json"}, {"--replay", "--json"}},
      {{"dark.xml", "--paths", "3"}, {"no path", "light"}},
      {{"dark.xml", "--replay", "2"}, {"path 2", "light"}},
  };
  // The lamp turned to the sky.
  std::string dark = kScene;
  dark.replace(dark.find("angle=\"90\""), 10, "angle=\"-90\"");
  write("dark.xml", dark);
  const std::set<std::string> before = files();
  for (const Mistake& mistake : mistakes) {
    const Outcome outcome = gradcheck(mistake.arguments);
    SCOPED_TRACE(::testing::PrintToString(mistake.arguments));
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(outcome.err.rfind("driftlight: error: ", 0), 0U) << outcome.err;
    for (const std::string& fragment : mistake.fragments)
      EXPECT_TRUE(contains(outcome.err, fragment)) << fragment << " in\n" << outcome.err;
    EXPECT_EQ(files(), before);
  }
}

TEST_F(GradcheckCli, HelpSucceeds) {
  const Outcome outcome = gradcheck({"--help"});
  EXPECT_EQ(outcome.exit_code, 0);
  for (const char* flag : {"--paths", "--seed", "--json", "--replay", "--max-depth"})
    EXPECT_TRUE(contains(outcome.out, flag)) << flag;
}

class CheckedRender : public GradcheckCli,
                      public ::testing::WithParamInterface<std::vector<std::string>> {};

TEST_P(CheckedRender, LeavesItsImageAlone) {
  const auto render = [&](const std::string& name, const char* threads, bool check) {
    std::vector<std::string> arguments{"render", "scene.xml",  "-o",      name + ".exr",
                                       "--seed", "3",          "-t",      threads,
                                       "--set",  "drift=full", "--stats", name + ".json"};
    arguments.insert(arguments.end(), GetParam().begin(), GetParam().end());
    if (check) arguments.emplace_back("--check-gradients");
    return run(arguments);
  };
  const Outcome with = render("with", "2", true);
  ASSERT_EQ(with.exit_code, 0) << with.err;
  EXPECT_TRUE(contains(with.out, "gradients checked at ")) << with.out;
  const Outcome without = render("without", "2", false);
  ASSERT_EQ(without.exit_code, 0) << without.err;
  EXPECT_FALSE(contains(without.out, "gradients checked"));
  EXPECT_TRUE(read("with.exr") == read("without.exr"));
  const auto json = nlohmann::json::parse(read("with.json"));
  const auto& check = json.at("gradient_check");
  EXPECT_EQ(check.at("passed"), true);
  // The start of each chain at least, or of many of the short ones.
  EXPECT_GE(check.at("all").at("paths").get<int>(), 100);
  for (const char* quantity :
       {"gradient_hand", "gradient_ridders", "jacobian_ridders", "divergence"})
    EXPECT_GT(check.at("all").at(quantity).at("compared").get<int>(), 0) << quantity;
  EXPECT_FALSE(nlohmann::json::parse(read("without.json")).contains("gradient_check"));

  ASSERT_EQ(render("alone", "1", true).exit_code, 0);
  EXPECT_TRUE(read("with.exr") == read("alone.exr"));
  EXPECT_EQ(nlohmann::json::parse(read("alone.json")).at("gradient_check"), check);
}

/// In Mode::Redistribution with many short chains.
INSTANTIATE_TEST_SUITE_P(Modes, CheckedRender,
                         ::testing::Values(std::vector<std::string>{"--set", "mode=chain",
                                                                    "--mutations-per-pixel", "20"},
                                           std::vector<std::string>{
                                               "--set", "threshold=0.2", "--set", "perturbations=0",
                                               "--set", "chain_length=4", "--spp", "8"}),
                         [](const auto& instance) {
                           return std::string(instance.index == 0 ? "chain" : "redistribution");
                         });

TEST_F(GradcheckCli, RendersThatUseNoDerivativesCannotBeChecked) {
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"--integrator", "path"}, {"--set", "drift=none", "--set", "preconditioner=identity"}}) {
    std::vector<std::string> line{"render", "scene.xml", "-o", "a.exr", "--check-gradients"};
    line.insert(line.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_TRUE(contains(outcome.err, "--check-gradients")) << outcome.err;
    EXPECT_EQ(files(), (std::set<std::string>{"scene.xml"}));
  }
}

}  // namespace
}  // namespace driftlight
