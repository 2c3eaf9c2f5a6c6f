// SPDX-License-Identifier: Apache-2.0
/// `driftlight compare` as users meet it: figures, files, mistakes, and its page in a browser.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "driftlight/image.h"
#include "support/places.h"
#include "support/process.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using nlohmann::json;

/// A lit sphere on 24 x 16 pixels: six tiles.
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

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Runs the program in a folder of its own that holds scene.xml.
class CompareCli : public ::testing::Test {
 protected:
  CompareCli() {
    std::filesystem::create_directory(folder());
    std::ofstream(folder() / "scene.xml") << kScene;
  }

  std::filesystem::path folder() const { return directory_.path() / "work"; }

  std::string read(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(folder() / name, std::ios::binary).rdbuf();
    return text.str();
  }
  json results(const std::string& name = "out") const {
    return json::parse(read(name + "/results.json"));
  }
  std::set<std::string> files(const std::string& name = ".") const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder() / name))
      names.insert(entry.path().filename().string());
    return names;
  }

  Outcome run(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), test::program());
    test::Process process(arguments, folder(), directory_.path());
    const int exit_code = process.exit_code();
    return {exit_code, process.standard_output(), process.standard_error()};
  }
  Outcome compare(const std::vector<std::string>& arguments) const {
    std::vector<std::string> all{"compare", "scene.xml", "--out", "out"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return run(all);
  }
  void render_reference(const std::string& scene = "scene.xml") const {
    ASSERT_EQ(run({"render", scene, "-q", "--integrator", "path", "--spp", "2000", "--seed", "77",
                   "-o", "reference.exr"})
                  .exit_code,
              0);
  }
  const std::filesystem::path& scratch() const { return directory_.path(); }

  /// The elements of a page after its scripts have run.
  std::string dom_of(const std::string& browser, const std::filesystem::path& page) const {
    test::Process process(
        {browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
         "--user-data-dir=" + (scratch() / "profile").string(), "--virtual-time-budget=5000",
         "--dump-dom", "file://" + page.string()},
        folder(), scratch());
    EXPECT_EQ(process.exit_code(), 0) << process.standard_error();
    return process.standard_output();
  }

 private:
  test::SceneDirectory directory_;
};

// --- Results -------------------------------------------------------------------------------------

TEST_F(CompareCli, GivesAllFiguresOfAllIntegrators) {
  render_reference();
  const Outcome outcome = compare(
      {"--reference", "reference.exr", "--integrators",
       "path,langevin:mode=chain:chains=16:bootstrap=20000:direct=chain:delayed_rejection=on",
       "--spp", "16", "--mutations-per-pixel", "40", "--runs", "3", "--seed", "5", "-t", "2"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "relMSE")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "wrote out/report.html")) << outcome.out;
  const std::string chain =
      "langevin_mode=chain_chains=16_bootstrap=20000_direct=chain_delayed_rejection=on";
  EXPECT_EQ(files("out"),
            (std::set<std::string>{"results.json", "results.csv", "report.html", "error_scale.png",
                                   "reference.png", "path.exr", "path.png", "path_error.png",
                                   chain + ".exr", chain + ".png", chain + "_error.png"}));

  const json all = results();
  EXPECT_EQ(all.at("runs"), 3);
  EXPECT_EQ(all.at("threads"), 2);
  EXPECT_EQ(all.at("reference").at("file"), "reference.exr");
  EXPECT_EQ(all.at("image").at("width"), 24);
  EXPECT_EQ(all.at("budget").at("samples_per_pixel"), 16);
  ASSERT_EQ(all.at("integrators").size(), 2U);
  std::set<std::uint64_t> seeds;
  for (const json& integrator : all.at("integrators")) {
    SCOPED_TRACE(integrator.at("name"));
    EXPECT_EQ(integrator.at("options").at("max_depth"), 4);
    ASSERT_EQ(integrator.at("moments").size(), 4U);
    double fraction = 0.125;
    double error_before = 1e9;
    for (const json& moment : integrator.at("moments")) {
      EXPECT_EQ(moment.at("fraction"), fraction);
      EXPECT_EQ(moment.at("runs"), 3);
      EXPECT_GT(moment.at("seconds").get<double>(), 0.0);
      EXPECT_EQ(moment.at("spread").at("pairs"), 3);
      EXPECT_EQ(moment.at("error").at("by_run").size(), 3U);
      for (const char* name : {"mse", "relmse", "relmse_trimmed", "mape"})
        EXPECT_GT(moment.at("error").at(name).get<double>(), 0.0) << name;
      for (const char* name : {"mse", "relmse", "relmse_trimmed"}) {
        // Without a bias both see the same error.
        const double ratio =
            moment.at("spread").at(name).get<double>() / moment.at("error").at(name).get<double>();
        EXPECT_GT(ratio, 0.4) << name;
        EXPECT_LT(ratio, 2.5) << name;
      }
      EXPECT_LT(moment.at("error").at("mse").get<double>(), error_before);
      error_before = moment.at("error").at("mse").get<double>();
      fraction *= 2.0;
    }
    const json& brightness = integrator.at("brightness");
    EXPECT_LT(brightness.at("low"), brightness.at("mean"));
    EXPECT_LT(brightness.at("mean"), brightness.at("high"));
    EXPECT_NEAR(brightness.at("ratio").get<double>(), 1.0, 0.02);
    EXPECT_GT(brightness.at("p_value").get<double>(), 1e-4);
    EXPECT_EQ(integrator.at("tile_test").at("tiles"), 6);
    EXPECT_GT(integrator.at("tile_test").at("p_value").get<double>(), 1e-4);
    EXPECT_NEAR(integrator.at("agreement").at("rhat").get<double>(), 1.0, 0.5);
    EXPECT_GT(integrator.at("effective_samples_per_second").get<double>(), 0.0);
    EXPECT_TRUE(integrator.at("effective_families").is_null());
    for (const json& run : integrator.at("runs")) {
      seeds.insert(run.at("seed").get<std::uint64_t>());
      EXPECT_EQ(run.at("seed"), run.at("statistics").at("seed"));
    }
  }
  EXPECT_EQ(seeds, (std::set<std::uint64_t>{5, 6, 7, 8, 9, 10}));
  EXPECT_TRUE(all.at("integrators")[0].at("acceptance").is_null());
  const json& acceptance = all.at("integrators")[1].at("acceptance");
  for (const char* kernel : {"large_step", "small_step", "second_step"}) {
    EXPECT_GT(acceptance.at(kernel).get<double>(), 0.05);
    EXPECT_LT(acceptance.at(kernel).get<double>(), 1.0);
  }
}

TEST_F(CompareCli, ItsImagesAndErrorsAreThoseOfRenderAndDiff) {
  render_reference();
  ASSERT_EQ(compare({"--reference", "reference.exr", "--integrators", "bdpt,path", "--spp", "8",
                     "--runs", "2", "--seed", "3"})
                .exit_code,
            0);
  // The first run, with all of its metadata.
  ASSERT_EQ(run({"render", "scene.xml", "--integrator", "path", "--spp", "8", "--seed", "4", "-o",
                 "path.exr"})
                .exit_code,
            0);
  EXPECT_TRUE(read("path.exr") == read("out/path.exr"));
  const json figures = json::parse(run({"diff", "path.exr", "reference.exr", "--json"}).out);
  const json last = results().at("integrators")[1].at("moments").back().at("error").at("by_run")[0];
  for (const char* name : {"mse", "relmse", "relmse_trimmed", "mape"})
    EXPECT_NEAR(last.at(name).get<double>(), figures.at(name).get<double>(), 1e-12) << name;

  std::istringstream csv(read("out/results.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line.rfind("integrator,fraction,runs,seconds,work,mse,relmse,", 0), 0U) << line;
  int lines = 0;
  while (std::getline(csv, line)) {
    ++lines;
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 11) << line;
  }
  EXPECT_EQ(lines, 8);
}

/// Without what is measured by the clock.
void remove_times(json& value) {
  if (value.is_object()) {
    for (const char* name : {"seconds", "samples_per_second", "mutations_per_second",
                             "effective_samples_per_second", "threads"})
      value.erase(name);
  }
  if (value.is_structured())
    for (auto& part : value) remove_times(part);
}

TEST_F(CompareCli, TheSameSeedAndWorkGiveTheSameFiguresOnAnyNumberOfThreads) {
  const auto figures = [&](const std::string& name, const char* threads, const char* seed) {
    const Outcome outcome =
        run({"compare", "scene.xml", "--out", name, "--integrators",
             "light,langevin:pilot=1024,langevin:mode=chain:chains=16:bootstrap=20000", "--spp",
             "4", "--mutations-per-pixel", "10", "--runs", "2", "-t", threads, "--seed", seed});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    json all = results(name);
    remove_times(all);
    return all.dump() + read(name + "/light.exr");
  };
  const std::string one = figures("one", "1", "9");
  EXPECT_TRUE(one == figures("two", "3", "9"));
  EXPECT_FALSE(one == figures("three", "3", "10"));
}

TEST_F(CompareCli, RunsTakeTheTime) {
  ASSERT_EQ(compare({"--integrators", "path,langevin:pilot=1024", "--time", "0.4", "--runs", "2"})
                .exit_code,
            0);
  const json all = results();
  for (const json& integrator : all.at("integrators")) {
    const json& last = integrator.at("moments").back();
    EXPECT_EQ(last.at("fraction"), 1.0);
    EXPECT_GE(last.at("seconds").get<double>(), 0.4);
    EXPECT_LT(last.at("seconds").get<double>(), 5.0);
  }
}

TEST_F(CompareCli, WithoutAReferenceThereAreFiguresOfTheSpreadAndItSaysSo) {
  const Outcome outcome = compare({"--integrators", "path", "--spp", "4", "--runs", "2"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_TRUE(contains(outcome.err, "no reference")) << outcome.err;
  const json all = results();
  EXPECT_TRUE(all.at("reference").is_null());
  const json& integrator = all.at("integrators")[0];
  EXPECT_TRUE(integrator.at("tile_test").is_null());
  EXPECT_TRUE(integrator.at("brightness").at("p_value").is_null());
  for (const json& moment : integrator.at("moments")) {
    EXPECT_TRUE(moment.at("error").is_null());
    EXPECT_GT(moment.at("spread").at("relmse").get<double>(), 0.0);
  }
  EXPECT_EQ(files("out").count("reference.png"), 0U);
}

TEST_F(CompareCli, SeesABias) {
  render_reference();
  ASSERT_EQ(compare({"--reference", "reference.exr", "--integrators", "path", "--spp", "16",
                     "--runs", "5", "-D", "light=1.2"})
                .exit_code,
            0);
  const json integrator = results().at("integrators")[0];
  EXPECT_NEAR(integrator.at("brightness").at("ratio").get<double>(), 1.2, 0.02);
  EXPECT_LT(integrator.at("brightness").at("p_value").get<double>(), 1e-4);
  EXPECT_GT(integrator.at("tile_test").at("rejected").get<int>(), 3);
}

TEST_F(CompareCli, CountsTheFamiliesOfSplitting) {
  // A small lamp, and a mirror between it and the ball.
  std::string lamp = kScene;
  const std::size_t sky = lamp.find("<emitter");
  lamp.replace(sky, lamp.find("</emitter>") + 10 - sky,
               R"(<shape type="rectangle"><transform name="toWorld"><scale value="0.05"/>
<rotate x="1" angle="90"/><translate y="3"/></transform>
<emitter type="area"><spectrum name="radiance" value="1000"/></emitter></shape>
<shape type="sphere"><point name="center" x="1.8" y="0.3" z="-0.5"/><float name="radius" value="0.7"/>
<bsdf type="conductor"/></shape>)");
  std::ofstream(folder() / "scene.xml") << lamp;
  const Outcome outcome =
      compare({"--integrators", "langevin:pilot=1024:splitting_pilot=1024:split=all", "--spp", "2",
               "--runs", "2"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_GT(results().at("integrators")[0].at("effective_families").get<double>(), 1.0);
}

TEST_F(CompareCli, StudiesTheTermsOfTheStep) {
  // A floor too: chains have only indirect light to mutate.
  std::string floor = kScene;
  floor.replace(floor.find("</scene>"), 8,
                R"(<shape type="rectangle"><transform name="toWorld"><scale value="4"/>
<rotate x="1" angle="-90"/><translate y="-1"/></transform></shape></scene>)");
  std::ofstream(folder() / "scene.xml") << floor;
  render_reference();
  const Outcome outcome =
      compare({"--study", "terms:bootstrap=5000", "--reference", "reference.exr", "--time", "0.05",
               "--mutations-per-pixel", "4", "--runs", "2"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(files("out"), (std::set<std::string>{"equal_mutations", "equal_time", "terms.csv"}));
  std::set<std::string> kinds;
  for (const char* budget : {"out/equal_time", "out/equal_mutations"}) {
    EXPECT_EQ(files(budget).count("report.html"), 1U);
    const json all = results(budget);
    ASSERT_EQ(all.at("integrators").size(), 22U);
    for (const json& integrator : all.at("integrators")) {
      EXPECT_TRUE(contains(outcome.out, integrator.at("name"))) << outcome.out;
      const json& options = integrator.at("options");
      EXPECT_EQ(options.at("mode"), "chain");
      EXPECT_EQ(options.at("bootstrap"), 5000);
      kinds.insert(options.at("preconditioner").dump() + options.at("drift").dump() +
                   options.at("safety").dump() + options.at("time_step_cap").dump());
    }
  }
  EXPECT_EQ(kinds.size(), 22U);
  const json by_work = results("out/equal_mutations");
  for (const json& integrator : by_work.at("integrators"))
    EXPECT_NEAR(integrator.at("moments").back().at("work").get<double>(), 4.0, 0.4);
  const std::string csv = read("out/terms.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 23);
}

// --- Mistakes ------------------------------------------------------------------------------------

struct Mistake {
  std::vector<std::string> arguments;
  std::vector<std::string> fragments;  ///< of the message
};

TEST_F(CompareCli, MistakesAreNamedBeforeAnythingIsRendered) {
  write_image(folder() / "small.exr", Image(2, 2));
  std::ofstream(folder() / "text.exr") << "not an image";
  std::filesystem::create_directory(folder() / "full");
  std::ofstream(folder() / "full/results.json") << "old results";
  const std::vector<Mistake> mistakes{
      {{}, {"--integrators", "--study"}},
      {{"--study", "terms", "--integrators", "path"}, {"either", "--integrators", "--study"}},
      {{"--study", "colours"}, {"'colours'", "terms"}},
      {{"--study", "terms", "--spp", "4"}, {"--study", "--spp"}},
      {{"--study", "terms:drift=none"}, {"--study", "'drift'", "itself"}},
      {{"--study", "terms:mode=splitting"}, {"--study", "'mode'", "itself"}},
      {{"--study", "terms:bootstrap"}, {"terms", "--study", "'bootstrap'", "name=value"}},
      {{"--study", "terms:bootstarp=1"}, {"'bootstarp'", "bootstrap"}},
      {{"--integrators", "photons"}, {"'photons'", "langevin", "path", "bdpt", "light"}},
      {{"--integrators", "path,"}, {"unknown integrator ''"}},
      {{"--integrators", "path,bdpt,path"}, {"'path'", "twice"}},
      {{"--integrators", "path:drift=none"}, {"'drift'", "max_depth"}},
      {{"--integrators", "langevin:drift=sideways"}, {"drift", "'sideways'", "none|gradient|full"}},
      {{"--integrators", "langevin:drift"}, {"langevin", "'drift'", "name=value"}},
      {{"--integrators", "path", "--runs", "1"}, {"--runs", "'1'", "from 2"}},
      {{"--integrators", "path", "--time", "0"}, {"--time", "'0'", "> 0"}},
      {{"--integrators", "path", "--time", "1", "--spp", "4"}, {"--time", "--spp"}},
      {{"--integrators", "path", "--mutations-per-pixel", "4"}, {"path takes --spp"}},
      {{"--integrators", "path", "--spp", "4", "--mutations-per-pixel", "4"},
       {"--mutations-per-pixel", "mode=chain"}},
      {{"--integrators", "path,langevin:mode=chain", "--spp", "4"},
       {"langevin:mode=chain takes --mutations-per-pixel"}},
      {{"--integrators", "langevin:mode=chain", "--spp", "4", "--mutations-per-pixel", "4"},
       {"--spp"}},
      {{"--integrators", "path", "--reference", "missing.exr"}, {"missing.exr"}},
      {{"--integrators", "path", "--reference", "text.exr"}, {"text.exr"}},
      {{"--integrators", "path", "--reference", "small.exr"}, {"small.exr", "2 x 2", "24 x 16"}},
      {{"--integrators", "path", "--out", "full"}, {"'full'", "not empty"}},
      {{"--integrators", "path", "--out", "scene.xml"}, {"'scene.xml'", "no folder"}},
      {{"--integrators", "path", "--out", "nowhere/out"}, {"nowhere"}},
      {{"--integrators", "path", "-D", "light"}, {"-D", "'light'", "name=value"}},
      {{"--integrators", "path", "-D", "light=bright"}, {"scene.xml:", "bright"}},
  };
  const std::set<std::string> before = files();
  for (const Mistake& mistake : mistakes) {
    SCOPED_TRACE(::testing::PrintToString(mistake.arguments));
    std::vector<std::string> arguments{"compare", "scene.xml"};
    arguments.insert(arguments.end(), mistake.arguments.begin(), mistake.arguments.end());
    const auto gives = [&](const char* flag) {
      return std::find(arguments.begin(), arguments.end(), flag) != arguments.end();
    };
    if (!gives("--out")) arguments.insert(arguments.end(), {"--out", "out"});
    // It would take hours to render.
    if (!gives("--time") && !gives("--spp") && !gives("--mutations-per-pixel"))
      arguments.insert(arguments.end(), {"--time", "3600"});
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(outcome.err.rfind("driftlight: error: ", 0), 0U) << outcome.err;
    EXPECT_EQ(outcome.err.find("error:"), outcome.err.rfind("error:")) << outcome.err;
    for (const std::string& fragment : mistake.fragments)
      EXPECT_TRUE(contains(outcome.err, fragment)) << outcome.err;
    EXPECT_EQ(files(), before);
  }
  EXPECT_EQ(read("full/results.json"), "old results");
}

TEST_F(CompareCli, FillsAnEmptyFolder) {
  std::filesystem::create_directory(folder() / "out");
  EXPECT_EQ(compare({"--integrators", "path", "--spp", "1", "--runs", "2"}).exit_code, 0);
  EXPECT_EQ(files("out").count("report.html"), 1U);
  EXPECT_EQ(files(), (std::set<std::string>{"out", "scene.xml"}));
}

TEST_F(CompareCli, ASignalKeepsCompleteRoundsOrNothing) {
  test::Process early({test::program(), "compare", "scene.xml", "--out", "out", "--integrators",
                       "path", "--time", "3600"},
                      folder(), scratch(), test::Process::Stderr::Terminal);
  ASSERT_TRUE(early.wait_for(" left", std::chrono::seconds(60))) << early.standard_error();
  early.send(SIGINT);
  EXPECT_EQ(early.exit_code(), 1);
  EXPECT_TRUE(contains(early.standard_error(), "nothing is written")) << early.standard_error();
  EXPECT_EQ(files(), (std::set<std::string>{"scene.xml"}));

  test::Process late({test::program(), "compare", "scene.xml", "--out", "out", "--integrators",
                      "path", "--time", "0.1", "--runs", "100"},
                     folder(), scratch(), test::Process::Stderr::Terminal);
  ASSERT_TRUE(late.wait_for(" 50 %", std::chrono::seconds(60))) << late.standard_error();
  late.send(SIGINT);
  EXPECT_EQ(late.exit_code(), 0);
  EXPECT_TRUE(contains(late.standard_error(), "stopped early")) << late.standard_error();
  EXPECT_GE(results().at("runs").get<int>(), 48);
  EXPECT_LT(results().at("runs").get<int>(), 100);
}

TEST_F(CompareCli, ASignalInTheSecondHalfOfAStudyKeepsTheFirst) {
  test::Process study(
      {test::program(), "compare", "scene.xml", "--out", "out", "--study", "terms:bootstrap=1000",
       "--time", "0.02", "--mutations-per-pixel", "1e6", "--runs", "2"},
      folder(), scratch(), test::Process::Stderr::Terminal);
  const auto first_half_is_there = [&] {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder()))
      if (entry.path().filename() == "report.html") return true;
    return false;
  };
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!first_half_is_there() && std::chrono::steady_clock::now() < end)
    study.wait_for("nothing", std::chrono::milliseconds(50));  // but reads the terminal
  ASSERT_TRUE(first_half_is_there());
  study.send(SIGINT);
  EXPECT_EQ(study.exit_code(), 0);
  EXPECT_TRUE(contains(study.standard_error(), "no equal_mutations")) << study.standard_error();
  EXPECT_EQ(files("out"), std::set<std::string>{"equal_time"});
}

// --- The page ------------------------------------------------------------------------------------

/// A browser that runs without a window, if there is one.
std::optional<std::string> find_browser() {
  for (const char* path :
       {"/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"}) {
    if (std::filesystem::exists(path)) return path;
  }
  return std::nullopt;
}

TEST_F(CompareCli, ThePageNeedsNothingElse) {
  render_reference();
  ASSERT_EQ(compare({"--reference", "reference.exr", "--integrators", "path,bdpt", "--spp", "2",
                     "--runs", "2"})
                .exit_code,
            0);
  const std::string page = read("out/report.html");
  EXPECT_EQ(page.rfind("<!DOCTYPE html>", 0), 0U);
  for (const char* mark : {"{{style}}", "{{data}}", "{{script}}"})
    EXPECT_FALSE(contains(page, mark)) << mark;
  // The name space of SVG is no address to load.
  for (const char* outside : {"src=\"http", "href=", "url(", "@import", "fetch("})
    EXPECT_FALSE(contains(page, outside)) << outside;
  // Two images of each, the reference and the scale.
  std::size_t pictures = 0;
  for (std::size_t i = page.find("data:image/png;base64,"); i != std::string::npos;
       i = page.find("data:image/png;base64,", i + 1))
    ++pictures;
  EXPECT_EQ(pictures, 6U);
}

TEST_F(CompareCli, ThePageRunsInABrowser) {
  const std::optional<std::string> browser = find_browser();
  if (!browser) GTEST_SKIP() << "there is no chromium";
  std::filesystem::rename(folder() / "scene.xml", folder() / "a<b&c.xml");
  render_reference("a<b&c.xml");
  for (const bool with_reference : {true, false}) {
    std::vector<std::string> arguments{
        "compare", "a<b&c.xml", "--out",         with_reference ? "with" : "without", "--spp", "2",
        "--runs",  "2",         "--integrators", "path,bdpt,langevin:pilot=1024"};
    if (with_reference) arguments.insert(arguments.end(), {"--reference", "reference.exr"});
    const Outcome outcome = run(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const std::string dom =
        dom_of(*browser, folder() / (with_reference ? "with" : "without") / "report.html");
    const std::string head = dom.substr(0, dom.find("<head>"));
    EXPECT_TRUE(contains(head, "data-ready=\"yes\"")) << head;
    EXPECT_FALSE(contains(head, "data-error")) << head;
    EXPECT_TRUE(contains(dom, "<h1 id=\"title\">a&lt;b&amp;c.xml</h1>"));
    for (const char* name : {"path", "bdpt", "langevin:pilot=1024"}) {
      EXPECT_TRUE(contains(dom, std::string("<td>") + name + "</td>")) << name;
      EXPECT_TRUE(contains(dom, std::string("<span>") + name + "<small>")) << name;
    }
    EXPECT_EQ(contains(dom, "<span>reference<small>"), with_reference);
    EXPECT_EQ(contains(dom, "threads; no reference"), !with_reference);
    EXPECT_TRUE(contains(dom, "<polyline"));
    EXPECT_TRUE(contains(dom, "Spread, relMSE, trimmed</figcaption>"));
    EXPECT_EQ(contains(dom, "MAPE</figcaption>"), with_reference);
    EXPECT_FALSE(contains(dom, "NaN"));
    EXPECT_FALSE(contains(dom, "undefined<"));
  }
}

TEST_F(CompareCli, KeysAndButtonsFlipThroughTheImages) {
  const std::optional<std::string> browser = find_browser();
  if (!browser) GTEST_SKIP() << "there is no chromium";
  render_reference();
  ASSERT_EQ(compare({"--reference", "reference.exr", "--integrators", "path,bdpt", "--spp", "2",
                     "--runs", "2"})
                .exit_code,
            0);
  std::string page = read("out/report.html");
  page.insert(page.rfind("</body>"), R"script(<script>
const seen = [];
const see = () => seen.push(byId("caption").textContent);
const press = (key) => { dispatchEvent(new KeyboardEvent("keydown", { key })); see(); };
const shown = (name) => pictures.find((picture) => picture.name === name);
see();
for (const key of ["1", "ArrowRight", " ", " ", "3", "4", "ArrowRight"]) press(key);
const image_is_right = byId("picture").src === shown("bdpt").image;
press("e");
const error_is_right = byId("picture").src === shown("bdpt").error;
byId("choices").children[1].click();
see();
byId("choices").children[0].click();
see();
press("e");
byId("stage").dispatchEvent(
  new WheelEvent("wheel", { deltaY: -800, clientX: 400, clientY: 300, cancelable: true }));
const zoomed = byId("picture").style.transform;
press("2");
const kept = byId("picture").style.transform === zoomed && !zoomed.includes("scale(1)");
press("0");
const whole = byId("picture").style.transform;
document.documentElement.dataset.seen =
  [...seen, image_is_right, error_is_right, kept, whole].join("|");
</script>)script");
  std::ofstream(folder() / "flipped.html") << page;
  const std::string dom = dom_of(*browser, folder() / "flipped.html");
  const std::string head = dom.substr(0, dom.find("<head>"));
  EXPECT_FALSE(contains(head, "data-error")) << head;
  EXPECT_TRUE(contains(head,
                       "data-seen=\"path|reference|path|reference|path|bdpt|bdpt|bdpt|"
                       "bdpt: relative error|path: relative error|reference|reference|path|path|"
                       "true|true|true|translate(0px, 0px) scale(1)\""))
      << head;
}

}  // namespace
}  // namespace driftlight
