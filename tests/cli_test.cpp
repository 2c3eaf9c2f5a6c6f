// SPDX-License-Identifier: Apache-2.0
/// The program as users meet it: exit codes, messages, files, signals, determinism.
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "driftlight/image.h"
#include "support/places.h"
#include "support/process.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::Process;
using test::SceneDirectory;

/// A lit sphere on 24 x 16 pixels.
const std::string kScene = R"(<scene version="0.6.0">
  <integrator type="path"><integer name="maxDepth" value="4"/></integrator>
  <default name="light" value="1"/>
  <sensor type="perspective">
    <float name="fov" value="50"/>
    <transform name="toWorld"><lookat origin="0,1,-5" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="24"/><integer name="height" value="16"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <emitter type="constant"><spectrum name="radiance" value="$light"/></emitter>
  <shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" value="0.5"/></bsdf></shape>
</scene>
)";

struct Outcome {
  int exit_code;
  std::string out;
  std::string err;
};

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t i = text.find(part); i != std::string::npos; i = text.find(part, i + 1)) ++n;
  return n;
}

/// Runs the program in a folder of its own that holds scene.xml.
class Cli : public ::testing::Test {
 protected:
  Cli() {
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

  static std::vector<std::string> command(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), test::program());
    return arguments;
  }
  Outcome run(const std::vector<std::string>& arguments) const {
    Process process(command(arguments), folder(), directory_.path());
    const int exit_code = process.exit_code();
    return {exit_code, process.standard_output(), process.standard_error()};
  }
  Process on_terminal(const std::vector<std::string>& arguments) const {
    return {command(arguments), folder(), directory_.path(), Process::Stderr::Terminal};
  }

 private:
  SceneDirectory directory_;
};

// --- Mistakes ------------------------------------------------------------------------------------

struct Mistake {
  std::vector<std::string> arguments;
  std::vector<std::string> fragments;  ///< of the message
};

/// `--output` with an image in the folder is put before the arguments of each.
const std::vector<Mistake> kRenderMistakes{
    {{"missing.xml"}, {"missing.xml"}},
    {{"broken.xml"}, {"broken.xml:"}},
    {{"scene.xml", "--integrator", "photons"},
     {"'photons'", "langevin", "pssmlt", "mmlt", "h2mc", "lmc", "mala", "mlt", "erpt", "path",
      "bdpt", "light"}},
    {{"scene.xml", "--set", "speed=1"}, {"'speed'", "drift", "epsilon"}},
    {{"scene.xml", "--set", "drift=sideways"}, {"drift", "'sideways'", "none|gradient|full"}},
    {{"scene.xml", "--set", "epsilon=-1"}, {"epsilon", "'-1'", "> 0"}},
    {{"scene.xml", "--set", "max_depth=17"}, {"max_depth", "'17'", "[1, 16]"}},
    {{"scene.xml", "--integrator", "path", "--set", "drift=none"}, {"'drift'", "max_depth"}},
    {{"scene.xml", "--set", "epsilon"}, {"--set", "'epsilon'", "name=value"}},
    {{"scene.xml", "-D", "light"}, {"-D", "'light'", "name=value"}},
    {{"scene.xml", "-D", "light=bright"}, {"scene.xml:", "bright"}},
    {{"scene.xml", "--time", "soon"}, {"--time", "'soon'", "> 0"}},
    {{"scene.xml", "--time", "0"}, {"--time", "'0'", "> 0"}},
    {{"scene.xml", "--time", "-3"}, {"--time", "'-3'", "> 0"}},
    {{"scene.xml", "--time", "nan"}, {"--time", "'nan'", "> 0"}},
    {{"scene.xml", "--time", "inf"}, {"--time", "'inf'", "> 0"}},
    {{"scene.xml", "--time", "5s"}, {"--time", "'5s'", "> 0"}},
    {{"scene.xml", "--mutations-per-pixel", "1e999"}, {"--mutations-per-pixel", "'1e999'"}},
    {{"scene.xml", "--integrator", "path", "--spp", "1.5"}, {"--spp", "'1.5'", "integer"}},
    {{"scene.xml", "--integrator", "path", "--spp", "0"}, {"--spp", "'0'", "from 1"}},
    {{"scene.xml", "--threads", "-1"}, {"--threads", "'-1'", "from 0"}},
    {{"scene.xml", "--seed", "-1"}, {"--seed", "'-1'", "from 0"}},
    {{"scene.xml", "--seed", "0x10"}, {"--seed", "'0x10'"}},
    {{"scene.xml", "--set", "mode=chain", "--spp", "4"},
     {"--spp", "redistribution", "--mutations-per-pixel"}},
    {{"scene.xml", "--mutations-per-pixel", "4"},
     {"--mutations-per-pixel", "mode=chain", "redistribution", "--spp"}},
    {{"scene.xml", "--integrator", "path", "--mutations-per-pixel", "4"},
     {"--mutations-per-pixel", "langevin", "--spp"}},
    {{"scene.xml", "--integrator", "bdpt", "--mutations-per-pixel", "4"},
     {"--mutations-per-pixel", "bdpt", "--spp"}},
    {{"scene.xml", "--integrator", "mmlt", "--spp", "4"}, {"mmlt", "--mutations-per-pixel"}},
    {{"scene.xml", "--integrator", "mlt", "--spp", "4"}, {"mlt", "--mutations-per-pixel"}},
    {{"scene.xml", "--integrator", "erpt", "--mutations-per-pixel", "4"}, {"erpt", "--spp"}},
    {{"scene.xml", "--integrator", "pssmlt", "--set", "step_min=0.5"}, {"step_min", "step_max"}},
    {{"scene.xml", "--integrator", "mlt", "--set", "step_min=0.5"}, {"step_min", "step_max"}},
    {{"scene.xml", "--integrator", "erpt", "--set", "pilot=1"}, {"pilot", "'1'", "[256"}},
    {{"scene.xml", "--set", "second_scale=0"}, {"second_scale", "'0'", "> 0"}},
    {{"scene.xml", "--set", "second_scale=0.1"}, {"second_scale", "delayed_rejection=on"}},
    {{"scene.xml", "--set", "levels=2", "--set", "mode=chain"}, {"levels", "mode=splitting"}},
    {{"scene.xml", "--time", "1", "--mutations-per-pixel", "4"}, {"only one", "--time"}},
    {{"scene.xml", "--integrator", "path", "--time", "1", "--spp", "4"}, {"only one", "--spp"}},
    {{"scene.xml", "-v", "-q"}, {"-v", "-q"}},
    {{"scene.xml", "-o", "nowhere/b.exr"}, {"nowhere"}},
    {{"scene.xml", "-o", "b.xyz"}, {"b.xyz", "ending", ".exr"}},
    {{"scene.xml", "--stats", "nowhere/stats.json"}, {"nowhere"}},
    {{"scene.xml", "another.xml"}, {"another.xml"}},
    {{"scene.xml", "--fast"}, {"--fast"}},
    {{"scene.xml", "--seed"}, {"--seed"}},
    {{}, {"scene"}},
};

TEST_F(Cli, MistakesInARenderAreNamedAndLeaveNoImage) {
  write("broken.xml", "<scene version=\"0.6.0\">\n  <shape type=\"sphere\">\n</scene>\n");
  const std::set<std::string> before = files();
  for (const Mistake& mistake : kRenderMistakes) {
    std::vector<std::string> arguments{"render", "-o", "a.exr"};
    arguments.insert(arguments.end(), mistake.arguments.begin(), mistake.arguments.end());
    const Outcome outcome = run(arguments);
    std::string line;
    for (const std::string& argument : arguments) line += argument + " ";
    SCOPED_TRACE(line);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(outcome.err.rfind("driftlight: error: ", 0), 0U) << outcome.err;
    EXPECT_EQ(count(outcome.err, "error:"), 1U) << outcome.err;
    for (const std::string& fragment : mistake.fragments)
      EXPECT_NE(outcome.err.find(fragment), std::string::npos) << outcome.err;
    EXPECT_EQ(files(), before);
  }
}

TEST_F(Cli, OtherMistakesHaveTheSameExitCode) {
  write("text.exr", "not an image");
  write_image(folder() / "small.exr", Image(2, 2));
  write_image(folder() / "large.exr", Image(3, 2));
  const std::vector<std::vector<std::string>> lines{
      {},
      {"draw"},
      {"info"},
      {"info", "scene.xml", "--integrators"},
      {"info", "missing.xml"},
      {"diff"},
      {"diff", "small.exr"},
      {"diff", "small.exr", "missing.exr"},
      {"diff", "small.exr", "text.exr"},
      {"diff", "small.exr", "large.exr"},
  };
  for (const auto& arguments : lines) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << ::testing::PrintToString(arguments);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(outcome.err.rfind("driftlight: error: ", 0), 0U) << outcome.err;
  }
}

TEST_F(Cli, AMistakeLeavesAnOlderImageAlone) {
  write("a.exr", "an old file");
  EXPECT_EQ(run({"render", "missing.xml", "-o", "a.exr"}).exit_code, 2);
  EXPECT_EQ(read("a.exr"), "an old file");
}

// --- Help and inventories ------------------------------------------------------------------------

TEST_F(Cli, HelpAndVersionSucceed) {
  EXPECT_EQ(run({"--version"}).out.rfind("driftlight ", 0), 0U);
  for (const auto& arguments : std::vector<std::vector<std::string>>{{"--help"},
                                                                     {"render", "--help"},
                                                                     {"compare", "--help"},
                                                                     {"info", "--help"},
                                                                     {"diff", "-h"}}) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_NE(outcome.out.find("Usage"), std::string::npos) << outcome.out;
    EXPECT_EQ(outcome.err, "");
  }
}

TEST_F(Cli, InfoCountsTheSceneAndListsTheIntegrators) {
  const Outcome scene = run({"info", "scene.xml", "-D", "light=2"});
  EXPECT_EQ(scene.exit_code, 0) << scene.err;
  for (const char* part : {"24 x 16", "4 edges", "1 sphere", "1 diffuse", "1 constant"})
    EXPECT_NE(scene.out.find(part), std::string::npos) << part << " in\n" << scene.out;
  EXPECT_EQ(count(scene.out, " all\n"), 10U) << scene.out;
  const Outcome integrators = run({"info", "--integrators"});
  EXPECT_EQ(integrators.exit_code, 0) << integrators.err;
  for (const char* part : {"langevin: ", "pssmlt: ", "mmlt: ", "h2mc: ", "lmc: ", "mala: ", "mlt: ",
                           "erpt: ", "path: ", "bdpt: ", "light: ", "drift", "none|gradient|full",
                           "epsilon", "balance|power", "max_depth", "doi"})
    EXPECT_NE(integrators.out.find(part), std::string::npos) << part << integrators.out;
}

TEST_F(Cli, InfoSaysWhatIntegratorsMiss) {
  write("glass.xml", R"(<scene version="0.6.0">
    <sensor type="thinlens"><float name="apertureRadius" value="0.1"/><film type="hdrfilm"/>
    </sensor>
    <shape type="sphere"><bsdf type="dielectric"/></shape>
    <shape type="rectangle"><bsdf type="diffuse"><texture type="checkerboard" name="reflectance"/>
    </bsdf></shape>
    <emitter type="point"/></scene>)");
  const Outcome outcome = run({"info", "glass.xml"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* part :
       {"\nmlt         nothing: it needs a pinhole\n",
        "\nerpt        nothing: it needs a pinhole\n",
        "\nlight       all but what is seen by way of smooth mirrors and glass\n",
        "\npath        all but light of point, spot and directional emitters by way of smooth "
        "mirrors and glass\n",
        "\nlangevin    all but light of point, spot and directional emitters by way of smooth "
        "mirrors and glass that is seen by way of such\n",
        "\nbdpt        all but", "MB of meshes"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " in\n" << outcome.out;
}

/// With a misspelt property and one that the sphere does not know.
std::string with_slips() {
  std::string scene = kScene;
  const std::string shape = "<shape type=\"sphere\">";
  scene.replace(scene.find(shape), shape.size(),
                shape + R"(<float name="radious" value="2"/><float name="gloss" value="1"/>)");
  return scene;
}

TEST_F(Cli, WhatIsNotUsedIsNamedAndWithStrictAnError) {
  write("slips.xml", with_slips());
  const std::vector<std::string> render{"render", "slips.xml", "--integrator", "path",
                                        "--spp",  "1",         "-o",           "a.exr"};
  const Outcome lenient = run(render);
  EXPECT_EQ(lenient.exit_code, 0) << lenient.err;
  for (const char* part :
       {"driftlight: slips.xml:13:", "'radious'", "did you mean 'radius'?", "'gloss'"})
    EXPECT_NE(lenient.err.find(part), std::string::npos) << part << " in\n" << lenient.err;
  std::filesystem::remove(folder() / "a.exr");

  const std::set<std::string> before = files();
  std::vector<std::string> strict_render = render;
  strict_render.emplace_back("--strict");
  const std::vector<std::vector<std::string>> lines{
      strict_render,
      {"info", "slips.xml", "--strict"},
      {"gradcheck", "slips.xml", "--strict", "--paths", "1"},
      {"compare", "slips.xml", "--strict", "--integrators", "path", "--spp", "1", "--out", "d"}};
  for (const auto& arguments : lines) {
    const Outcome strict = run(arguments);
    EXPECT_EQ(strict.exit_code, 2) << arguments[0];
    EXPECT_EQ(count(strict.err, "error:"), 1U) << strict.err;
    for (const char* part : {"'radious'", "did you mean 'radius'?", "'gloss'", "   13 | ", "^"})
      EXPECT_NE(strict.err.find(part), std::string::npos) << part << " in\n" << strict.err;
    EXPECT_EQ(files(), before);
  }
  EXPECT_EQ(run({"info", "scene.xml", "--strict"}).exit_code, 0);
}

TEST_F(Cli, DiffPrintsTheFigures) {
  Image a(4, 2);
  Image b(4, 2);
  a.rgb.assign(a.rgb.size(), 3.0F);
  b.rgb.assign(b.rgb.size(), 2.0F);
  write_image(folder() / "a.exr", a);
  write_image(folder() / "b.pfm", b);
  const Outcome text = run({"diff", "a.exr", "b.pfm"});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* part : {"MSE             1\n", "0.249377", "0.497512", "mean ratio      1.5\n"})
    EXPECT_NE(text.out.find(part), std::string::npos) << part << " in\n" << text.out;
  const Outcome json = run({"diff", "a.exr", "b.pfm", "--json"});
  EXPECT_EQ(json.exit_code, 0) << json.err;
  const auto figures = nlohmann::json::parse(json.out);
  EXPECT_NEAR(figures.at("mse").get<double>(), 1.0, 1e-12);
  EXPECT_NEAR(figures.at("relmse").get<double>(), 1.0 / 4.01, 1e-12);
  EXPECT_NEAR(figures.at("relmse_trimmed").get<double>(), 1.0 / 4.01, 1e-12);
  EXPECT_NEAR(figures.at("mape").get<double>(), 1.0 / 2.01, 1e-12);
  EXPECT_NEAR(figures.at("mean_ratio").get<double>(), 1.5, 1e-12);
}

// --- Renders -------------------------------------------------------------------------------------

TEST_F(Cli, RendersIntoEveryFileThatWasAskedFor) {
  const Outcome outcome = run({"render",
                               "scene.xml",
                               "-o",
                               "a.exr",
                               "-o",
                               "a.png",
                               "-oa.pfm",
                               "--stats",
                               "s.json",
                               "--mutations-per-pixel",
                               "20",
                               "--set",
                               "mode=chain",
                               "--set",
                               "drift=full",
                               "--set",
                               "direct=chain",
                               "-t",
                               "2",
                               "--seed",
                               "5",
                               "-v"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(files(), (std::set<std::string>{"a.exr", "a.pfm", "a.png", "s.json", "scene.xml"}));
  const Image image = read_image(folder() / "a.exr");
  EXPECT_EQ(image.width, 24);
  EXPECT_EQ(image.height, 16);
  EXPECT_EQ(image.rgb, read_image(folder() / "a.pfm").rgb);
  for (const char* part : {"langevin", "wrote a.exr", "wrote a.png", "large steps", "acceptance"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " in\n" << outcome.out;

  const auto json = nlohmann::json::parse(read("s.json"));
  EXPECT_EQ(json.at("integrator"), "langevin");
  EXPECT_EQ(json.at("options").at("drift"), "full");
  EXPECT_EQ(json.at("options").at("max_depth"), 4);
  EXPECT_EQ(json.at("seed"), 5);
  EXPECT_EQ(json.at("threads"), 2);
  EXPECT_EQ(json.at("image").at("width"), 24);
  EXPECT_GT(json.at("b").get<double>(), 0.0);
  EXPECT_GT(json.at("b_error").get<double>(), 0.0);
  const auto mutations = json.at("mutations").get<std::uint64_t>();
  EXPECT_GE(mutations, 20U * 24U * 16U);
  const auto& kernels = json.at("kernels");
  EXPECT_EQ(kernels.at("large_step").at("proposed").get<std::uint64_t>() +
                kernels.at("small_step").at("proposed").get<std::uint64_t>(),
            mutations);
  for (const char* reason : {"missed", "other_lobe", "occluded", "non_finite", "hastings"})
    EXPECT_TRUE(json.at("rejections").contains(reason)) << reason;
  std::uint64_t spent = 0;
  for (const auto& n : json.at("path_lengths")) spent += n.get<std::uint64_t>();
  EXPECT_EQ(spent, mutations);
  for (const char* phase : {"load", "bootstrap", "render", "write"})
    EXPECT_GE(json.at("seconds").at(phase).get<double>(), 0.0) << phase;
}

TEST_F(Cli, PathTracerReportsItsSamples) {
  const Outcome outcome =
      run({"render", "scene.xml", "--integrator", "path", "--spp", "3", "-q", "--stats", "s.json"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err, "");
  // The default name is that of the scene.
  EXPECT_EQ(files(), (std::set<std::string>{"s.json", "scene.exr", "scene.xml"}));
  const auto json = nlohmann::json::parse(read("s.json"));
  EXPECT_EQ(json.at("integrator"), "path");
  EXPECT_EQ(json.at("samples_per_pixel"), 3.0);
  EXPECT_EQ(json.at("options").at("max_depth"), 4);
}

// Two samples a pixel start so few particles that their light is not to be trusted.
TEST_F(Cli, ParticlesAreReportedAndDoubtedWhereTheyAreFew) {
  const std::vector<std::string> arguments{"render",  test::own_scene("sun_pane").string(),
                                           "-D",      "width=48",
                                           "-D",      "height=36",
                                           "--spp",   "2",
                                           "--set",   "split=all",
                                           "--set",   "splitting_pilot=1024",
                                           "--set",   "pilot=4096",
                                           "-o",      "a.exr",
                                           "--stats", "s.json",
                                           "-v"};
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("of the light rests on so few families"), std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.out.find("level 0: "), std::string::npos) << outcome.out;
  const auto splitting = nlohmann::json::parse(read("s.json")).at("splitting");
  EXPECT_GT(splitting.at("lobe_sequences"), 0);
  EXPECT_GT(splitting.at("effective_families"), 1.0);
  EXPECT_GT(splitting.at("mean"), 0.0);
  // Of all tiles, but for rounding.
  EXPECT_LE(splitting.at("mean_of_few_families").get<double>(),
            (1.0 + 1e-9) * splitting.at("mean").get<double>());
  ASSERT_GT(splitting.at("levels").size(), 1U);
  for (const auto& level : splitting.at("levels")) {
    EXPECT_GT(level.at("particles"), 0);
    EXPECT_GT(level.at("steps"), 0);
    EXPECT_GT(level.at("acceptance"), 0.0);
  }
}

// The sampler's number is the default of what counts samples, and is spoken of only there.
TEST_F(Cli, TheSamplerSaysHowManySamples) {
  std::string scene = kScene;
  scene.insert(
      scene.find("    <film"),
      "<sampler type=\"independent\"><integer name=\"sampleCount\" value=\"3\"/></sampler>");
  write("sampled.xml", scene);
  const auto render = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"render",  "sampled.xml", "-o",    "a.exr",
                                       "--stats", "s.json",      "--set", "max_depth=2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.err;
  };
  const auto samples = [&] {
    return nlohmann::json::parse(read("s.json")).at("samples_per_pixel");
  };
  EXPECT_NE(render({"--integrator", "path"}).find("3 samples per pixel"), std::string::npos);
  EXPECT_EQ(samples(), 3.0);
  EXPECT_EQ(render({"--integrator", "path", "--spp", "2"}), "");
  EXPECT_EQ(samples(), 2.0);
  EXPECT_EQ(render({"--integrator", "path", "--time", "0.1"}), "");
  EXPECT_EQ(render({"--integrator", "mlt", "--mutations-per-pixel", "1"}), "");
  EXPECT_NE(run({"info", "sampled.xml"}).out.find("3 per pixel"), std::string::npos);
}

TEST_F(Cli, TheImageAndTheStatisticsNameTheScene) {
  std::filesystem::create_directory(folder() / "scenes");
  write("scenes/scene.xml", kScene);
  const auto render = [&](const std::string& light) {
    const std::vector<std::string> arguments{
        "render", "scenes/scene.xml", "-D",   "light=" + light, "-o",    "a.exr", "--spp",
        "1",      "--integrator",     "path", "--stats",        "s.json"};
    EXPECT_EQ(run(arguments).exit_code, 0);
    return nlohmann::json::parse(read("s.json")).at("scene");
  };
  const auto scene = render("2");
  EXPECT_EQ(scene.at("file"), "scene.xml");
  EXPECT_EQ(scene.at("defines").at("light"), "2");
  // FNV-1a of 64 bits.
  std::uint64_t hash = 14695981039346656037U;
  for (const char c : kScene) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211U;
  EXPECT_EQ(scene.at("hash"), fmt::format("fnv1a64:{:016x}", hash));

  const auto input = OIIO::ImageInput::open((folder() / "a.exr").string());
  ASSERT_TRUE(input);
  const auto attribute = [&](const char* name) {
    return std::string(input->spec().get_string_attribute(name));
  };
  EXPECT_EQ(attribute("driftlight:scene"), "scene.xml");
  EXPECT_EQ(attribute("driftlight:scene_hash"), scene.at("hash").get<std::string>());
  EXPECT_EQ(attribute("driftlight:defines"), "light=2");
  EXPECT_EQ(render("3").at("hash"), scene.at("hash"));
  write("scenes/scene.xml", kScene + "\n");
  EXPECT_NE(render("3").at("hash"), scene.at("hash"));
}

TEST_F(Cli, DefinesReachTheScene) {
  for (const char* light : {"1", "3"}) {
    const std::string file = std::string(light) + ".exr";
    ASSERT_EQ(run({"render", "scene.xml", "-D", std::string("light=") + light, "-o", file,
                   "--integrator", "path", "--spp", "4"})
                  .exit_code,
              0);
  }
  const Difference d = difference(read_image(folder() / "3.exr"), read_image(folder() / "1.exr"));
  EXPECT_NEAR(d.mean, 3.0, 1e-5);
}

TEST_F(Cli, TheSceneDepthIsLimitedWithANotice) {
  std::string deep = kScene;
  deep.replace(deep.find("value=\"4\""), 9, "value=\"40\"");
  write("deep.xml", deep);
  const std::vector<std::string> arguments{"render", "deep.xml", "--spp", "1", "--stats", "s.json"};
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("40 edges"), std::string::npos) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(read("s.json")).at("options").at("max_depth"), 16);

  std::vector<std::string> with_depth = arguments;
  with_depth.insert(with_depth.end(), {"--set", "max_depth=3"});
  EXPECT_EQ(run(with_depth).err, "");
  EXPECT_EQ(nlohmann::json::parse(read("s.json")).at("options").at("max_depth"), 3);
}

TEST_F(Cli, TheSameSeedGivesTheSameBytesOnAnyNumberOfThreads) {
  const std::vector<std::vector<std::string>> integrators{
      {"--integrator", "langevin", "--set", "mode=chain", "--set", "bootstrap=4000",
       "--mutations-per-pixel", "20"},
      {"--integrator", "langevin", "--set", "pilot=4096", "--spp", "4"},
      {"--integrator", "pssmlt", "--set", "bootstrap=4000", "--mutations-per-pixel", "20"},
      {"--integrator", "mmlt", "--set", "bootstrap=4000", "--mutations-per-pixel", "20"},
      {"--integrator", "h2mc", "--set", "bootstrap=4000", "--mutations-per-pixel", "2"},
      {"--integrator", "lmc", "--set", "bootstrap=4000", "--mutations-per-pixel", "2"},
      {"--integrator", "mlt", "--set", "bootstrap=4000", "--mutations-per-pixel", "20"},
      {"--integrator", "erpt", "--set", "pilot=4096", "--spp", "1"},
      {"--integrator", "path", "--spp", "4"},
      {"--integrator", "bdpt", "--spp", "4"},
      {"--integrator", "light", "--spp", "4"},
  };
  for (const auto& integrator : integrators) {
    const auto bytes = [&](const char* threads, const char* seed) {
      std::vector<std::string> arguments{"render", "scene.xml", "-o",     "a.exr",
                                         "-t",     threads,     "--seed", seed};
      arguments.insert(arguments.end(), integrator.begin(), integrator.end());
      EXPECT_EQ(run(arguments).exit_code, 0);
      return read("a.exr");
    };
    const std::string one = bytes("1", "9");
    EXPECT_GT(one.size(), 100U);
    EXPECT_TRUE(one == bytes("1", "9"));
    EXPECT_TRUE(one == bytes("2", "9"));
    EXPECT_TRUE(one == bytes("4", "9"));
    EXPECT_FALSE(one == bytes("2", "10"));
  }
}

TEST_F(Cli, TimeEndsTheRender) {
  for (const char* integrator : {"langevin", "pssmlt", "mmlt", "h2mc", "lmc", "mala", "mlt", "erpt",
                                 "path", "bdpt", "light"}) {
    const auto start = std::chrono::steady_clock::now();
    const Outcome outcome = run({"render", "scene.xml", "--integrator", integrator, "--time", "0.4",
                                 "-o", "a.exr", "--stats", "s.json"});
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_GT(elapsed.count(), 0.35);
    EXPECT_LT(elapsed.count(), 20.0);
    EXPECT_EQ(read_image(folder() / "a.exr").width, 24);
    EXPECT_EQ(nlohmann::json::parse(read("s.json")).at("stopped"), false);
  }
}

TEST_F(Cli, ASignalEndsTheRenderWithTheImageSoFar) {
  struct Case {
    std::vector<std::string> integrator;
    int signal;
  };
  // A short pilot, as there is no image before its end.
  for (const Case& stopped : {Case{{"langevin", "--set", "pilot=1024"}, SIGINT},
                              Case{{"path"}, SIGTERM}, Case{{"bdpt"}, SIGINT}}) {
    std::vector<std::string> arguments{"render", "scene.xml", "--time", "3600",        "-o",
                                       "a.exr",  "--stats",   "s.json", "--integrator"};
    arguments.insert(arguments.end(), stopped.integrator.begin(), stopped.integrator.end());
    Process process = on_terminal(arguments);
    // The bar counts down from an hour: a second has passed.
    ASSERT_TRUE(process.wait_for(" 59:59 left", std::chrono::seconds(60)))
        << process.standard_error();
    process.send(stopped.signal);
    EXPECT_EQ(process.exit_code(), 0);
    EXPECT_NE(process.standard_error().find("stopped early"), std::string::npos)
        << process.standard_error();
    const Image image = read_image(folder() / "a.exr");
    float sum = 0;
    for (const float x : image.rgb) sum += x;
    EXPECT_GT(sum, 0.0F);
    EXPECT_EQ(nlohmann::json::parse(read("s.json")).at("stopped"), true);
    EXPECT_EQ(files(), (std::set<std::string>{"a.exr", "s.json", "scene.xml"}));
    std::filesystem::remove(folder() / "a.exr");
    std::filesystem::remove(folder() / "s.json");
  }
}

TEST_F(Cli, ProgressIsForTerminalsOnly) {
  EXPECT_EQ(run({"render", "scene.xml", "--time", "0.3"}).err.find('%'), std::string::npos);
  Process quiet = on_terminal({"render", "scene.xml", "--time", "0.3", "-q"});
  EXPECT_EQ(quiet.exit_code(), 0);
  EXPECT_EQ(quiet.standard_error(), "");
}

}  // namespace
}  // namespace driftlight
