// SPDX-License-Identifier: Apache-2.0
/// What messages about scene files say: the place, the line itself, the nearest names, and all that
/// is wrong at once.
#include <gtest/gtest.h>

#include "driftlight/scene_file.h"
#include "scene_file/excerpt.h"
#include "scene_file/nearest_names.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::complete;
using test::expect_contains;
using test::kEmitter;
using test::kSensor;
using test::kShape;
using test::lit;
using test::scene_file;
using test::SceneDirectory;

std::string error_of(const std::string& content, bool strict = false) {
  const SceneDirectory directory;
  return test::scene_error([&] { directory.load(content, {.defines = {}, .strict = strict}); });
}

std::vector<std::string> notices_of(const std::string& content) {
  const SceneDirectory directory;
  return directory.load(content).notices;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t i = text.find(part); i != std::string::npos; i = text.find(part, i + 1)) ++n;
  return n;
}

// --- Names ---------------------------------------------------------------------------------------

TEST(NearestNames, CountsSlips) {
  EXPECT_EQ(edit_distance("radius", "radius"), 0U);
  EXPECT_EQ(edit_distance("radus", "radius"), 1U);
  EXPECT_EQ(edit_distance("radiuss", "radius"), 1U);
  EXPECT_EQ(edit_distance("radios", "radius"), 1U);
  EXPECT_EQ(edit_distance("raduis", "radius"), 1U);  // swapped
  EXPECT_EQ(edit_distance("", "abc"), 3U);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
  // Spellings of one name.
  EXPECT_EQ(edit_distance("maxdepth", "maxDepth"), 0U);
  EXPECT_EQ(edit_distance("max_depth", "maxDepth"), 0U);
}

TEST(NearestNames, OffersWhatMayBeASlip) {
  const std::vector<std::string> names{"alpha", "reflectance", "radius", "radiance"};
  EXPECT_EQ(hint("reflectence", names), "did you mean 'reflectance'?");
  EXPECT_EQ(hint("radus", {"radius", "radiuses", "rads"}), "did you mean 'radius' or 'rads'?");
  EXPECT_EQ(hint("shine", names), "valid are: alpha, reflectance, radius, radiance");
  EXPECT_EQ(hint("shine", {}), "valid are: none");
  std::vector<std::string> many;
  for (char c = 'a'; c <= 'z'; ++c) many.push_back(std::string("name_") + c + c + c + c + c);
  EXPECT_EQ(hint("ppp", many),
            "the nearest of 26 are: name_ppppp, name_aaaaa, name_bbbbb, name_ccccc, name_ddddd");
}

// --- Lines ---------------------------------------------------------------------------------------

TEST(Excerpt, MarksTheColumn) {
  const std::string text = "first\n\tsecond <x/>\r\nthird";
  EXPECT_EQ(excerpt(text, {"", 2, 9}), "\n    2 | \tsecond <x/>\n      | \t       ^");
  EXPECT_EQ(excerpt(text, {"", 3, 0}), "\n    3 | third");
  EXPECT_EQ(excerpt(text, {"", 4, 1}), "");
  EXPECT_EQ(excerpt("", {"", 1, 1}), "");
  EXPECT_EQ(excerpt("\xC3\xA4\x1B|", {"", 1, 3}), "\n    1 | \xC3\xA4 |\n      |   ^");
}

TEST(Excerpt, ShowsAPartOfALongLine) {
  std::string line(1000, '.');
  line[500] = 'x';
  const std::string shown = excerpt(line, {"", 1, 501});
  EXPECT_LT(shown.size(), 250U);
  const std::size_t second = shown.find('\n', 1);
  EXPECT_EQ(shown.find('x') - 1, shown.find('^') - (second + 1));
}

TEST(Messages, ShowTheLine) {
  const std::string error =
      error_of(complete("  <shape type=\"torus\"><bsdf type=\"diffuse\"/></shape>\n"));
  expect_contains(error, "scene.xml:2:3: unknown shape 'torus'");
  expect_contains(error,
                  "\n    2 |   <shape type=\"torus\"><bsdf type=\"diffuse\"/></shape>"
                  "\n      |   ^");
  expect_contains(error_of("<scene version=\"0.6.0\">\n</shape>\n"), "\n    2 | </shape>\n");
}

TEST(Messages, ShowTheLineOfTheFileThatIsWrong) {
  const SceneDirectory directory;
  directory.write("part.xml", scene_file("\n <bsdf type=\"velvet\"/>"));
  const std::string included =
      test::scene_error([&] { directory.load(complete("<include filename=\"part.xml\"/>")); });
  expect_contains(included, "part.xml:3:2: ");
  expect_contains(included, "\n    3 |  <bsdf type=\"velvet\"/>\n      |  ^");

  directory.write("mesh.obj", "mtllib some.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
  const auto library_error = [&](const std::string& library) {
    directory.write("some.mtl", library);
    return test::scene_error([&] {
      directory.load(
          lit(R"(<shape type="obj"><string name="filename" value="mesh.obj"/></shape>)"));
    });
  };
  const std::string number = library_error("newmtl a\nKd 1 one 0\n");
  expect_contains(number, "some.mtl:2:1: ");
  expect_contains(number, "\n    2 | Kd 1 one 0\n      | ^");
  const std::string color = library_error("# dark\nnewmtl a\nKd -1 0 0\n");
  expect_contains(color, "some.mtl:2:1: ");
  expect_contains(color, "\n    2 | newmtl a\n");
}

TEST(Messages, NameTheNearest) {
  expect_contains(error_of(complete(R"(<bsdf type="roughconducter"/>)")),
                  "did you mean 'roughconductor'?");
  expect_contains(error_of(complete(R"(<bsdf type="velvet"/>)")), "the nearest of ");
  expect_contains(error_of(complete(
                      R"(<bsdf type="dielectric"><string name="intIOR" value="diamnod"/></bsdf>)")),
                  "did you mean 'diamond'?");
  expect_contains(error_of(lit(R"(<bsdf type="diffuse" id="white"/><bsdf type="diffuse" id="red"/>
                                  <shape type="sphere"><ref id="whit"/></shape>)")),
                  "nothing has the id 'whit'; did you mean 'white'?");
  expect_contains(error_of(lit(R"(<default name="size" value="1"/>
          <shape type="sphere"><float name="radius" value="$szie"/></shape>)")),
                  "'$szie' has no value");
  expect_contains(error_of(lit(R"(<default name="size" value="1"/>
          <shape type="sphere"><float name="radius" value="$szie"/></shape>)")),
                  "did you mean 'size'?");
  expect_contains(error_of(complete(R"(<shpae type="sphere"/>)")), "did you mean 'shape'?");
  expect_contains(error_of(complete(R"(<shape type="sphere"><bsfd type="diffuse"/></shape>)")),
                  "did you mean 'bsdf'?");
  expect_contains(
      error_of(
          complete(R"(<texture type="bitmap"><string name="filname" value="a.png"/></texture>)")),
      "lacks the <string> 'filename'; is it meant by 'filname'?");
  expect_contains(error_of(complete(R"(<texture type="bitmap">
          <string name="filename" value="a.png"/><string name="wrapMode" value="repaet"/>
          </texture>)")),
                  "a.png");
}

// --- What nobody uses ----------------------------------------------------------------------------

struct Unused {
  const char* body;
  std::vector<std::string> fragments;  ///< of the notice
};

const Unused kUnused[] = {
    {R"(<bsdf type="diffuse"><rgb name="reflectence" value="1"/></bsdf>)",
     {"scene.xml:2:22: ", "'reflectence'", "bsdf 'diffuse'", "did you mean 'reflectance'?"}},
    {R"(<bsdf type="diffuse"><float name="shine" value="1"/></bsdf>)",
     {"'shine'", "valid are: ", "reflectance"}},
    {R"(<shape type="sphere"><float name="radius" value="1" unit="m"/></shape>)",
     {"'unit'", "<float>", "value"}},
    {R"(<shape type="sphere" tpye="disk"/>)", {"'tpye'", "<shape>", "'type'"}},
    {R"(<shape type="sphere"><float value="2"/></shape>)", {"<float>", "shape 'sphere'"}},
    {R"(<bsdf type="diffuse"><texture type="checkerboard"/></bsdf>)", {"<texture>", "bsdf"}},
    {R"(<emitter type="spot"><point name="position" x="1" y="1" z="1"/></emitter>)",
     {"'position'", "emitter 'spot'"}},
    {R"(<emitter type="point"><rgb name="intenstiy" value="3"/></emitter>)", {"'intensity'"}},
    {R"(<integrator type="path"><integer name="maxdepht" value="3"/></integrator>)",
     {"'maxdepht'", "integrator 'path'", "did you mean 'maxDepth'?"}},
    {R"(<texture type="checkerboard"><rgb name="colour0" value="1"/></texture>)", {"'color0'"}},
    {R"(<shape type="sphere"><transform name="toWorld"><scale value="1" w="1"/></transform>
        </shape>)",
     {"'w'", "<scale>"}},
};

TEST(UnusedProperties, AreNamedOnceAndLeaveTheSceneAsItIs) {
  for (const Unused& unused : kUnused) {
    SCOPED_TRACE(unused.body);
    std::vector<std::string> found;
    for (const std::string& notice : notices_of(complete(unused.body)))
      if (notice.find("not used") != std::string::npos) found.push_back(notice);
    ASSERT_EQ(found.size(), 1U);
    for (const std::string& fragment : unused.fragments) expect_contains(found[0], fragment);
  }
}

TEST(UnusedProperties, AreErrorsIfThatIsWanted) {
  for (const Unused& unused : kUnused) {
    SCOPED_TRACE(unused.body);
    const std::string error = error_of(complete(unused.body), true);
    for (const std::string& fragment : unused.fragments) expect_contains(error, fragment);
    expect_contains(error, "^");
  }
}

TEST(UnusedProperties, OfSensorsAreNamed) {
  const auto scene = [](const std::string& sensor_content, const std::string& film_content) {
    return scene_file(R"(<sensor type="perspective">)" + sensor_content +
                      R"(<film type="hdrfilm">)" + film_content + "</film></sensor>" + kEmitter +
                      kShape);
  };
  const std::string sampler = R"(<sampler type="independent"><integer name="samplecont" value="9"/>
      </sampler>)";
  for (const auto& [content, name] :
       {std::pair{scene(R"(<float name="fovv" value="30"/>)", ""), "'fov'"},
        std::pair{scene("", R"(<integer name="with" value="30"/>)"), "'width'"},
        std::pair{scene("", R"(<rfilter type="gaussian"><float name="stdev" value="0.4"/>
                               </rfilter>)"),
                  "'stddev'"},
        std::pair{scene(sampler, ""), "'sampleCount'"}}) {
    const std::vector<std::string> notices = notices_of(content);
    ASSERT_EQ(notices.size(), 1U);
    expect_contains(notices[0], name);
    expect_contains(error_of(content, true), name);
  }
}

TEST(UnusedProperties, AreAllInOneReport) {
  const std::string body = R"(<bsdf type="diffuse" id="a"><float name="one" value="1"/>
      <float name="two" value="1"/></bsdf>
      <shape type="sphere" three="3"><float name="radious" value="2"/><ref id="a"/></shape>)";
  const std::string error = error_of(complete(body), true);
  for (const char* name : {"'one'", "'two'", "'three'", "'radious'"})
    EXPECT_EQ(count(error, name), 1U) << error;
  expect_contains(error, "\n4 errors");
  EXPECT_EQ(notices_of(complete(body)).size(), 4U);
}

// What Mitsuba would use, and what we do not have, is not only named.
TEST(UnusedProperties, ThatWouldChangeThePictureAreRefused) {
  for (const char* body :
       {R"(<shape type="sphere"><subsurface type="dipole"/></shape>)",
        R"(<shape type="sphere"><medium name="interior" type="homogeneous"/></shape>)",
        R"(<shape type="sphere"><ref name="interior" id="fog"/></shape>)",
        R"(<shape type="sphere"><sensor type="irradiancemeter"/></shape>)",
        R"(<bsdf type="diffuse"><emitter type="area"/></bsdf>)",
        R"(<shape type="sphere"><animation name="toWorld"/></shape>)",
        R"(<bsdf type="roughplastic"><texture name="alpha" type="checkerboard"/></bsdf>)",
        R"(<bsdf type="roughconductor"><texture name="alphaU" type="checkerboard"/></bsdf>)",
        R"(<bsdf type="phong"><texture name="exponent" type="checkerboard"/></bsdf>)",
        R"(<emitter type="spot"><texture name="texture" type="checkerboard"/></emitter>)",
        R"(<integrator type="path"><boolean name="hideEmitters" value="true"/></integrator>)"}) {
    SCOPED_TRACE(body);
    EXPECT_FALSE(error_of(complete(body)).empty());
  }
}

TEST(UnusedProperties, OfIntegratorsThatMitsubaKnowsAreInOneNotice) {
  const std::string scene = complete(R"(<integrator type="path">
      <integer name="rrDepth" value="5"/><boolean name="strictNormals" value="true"/>
      <integer name="maxDepth" value="7"/></integrator>)");
  const std::vector<std::string> notices = notices_of(scene);
  ASSERT_EQ(notices.size(), 1U);
  expect_contains(notices[0], "rrDepth, strictNormals of integrator 'path' are not used");
  const SceneDirectory directory;
  EXPECT_EQ(directory.load(scene, {.defines = {}, .strict = true}).max_depth, 7);

  const auto other = [](const std::string& name) {
    return complete(R"(<integrator type="guided_path"><string name="budgetType" value="spp"/>
        <integer name=")" +
                    name + R"(" value="7"/></integrator>)");
  };
  EXPECT_EQ(directory.load(other("maxDepth"), {.defines = {}, .strict = true}).max_depth, 7);
  expect_contains(error_of(other("maxdepht"), true), "did you mean 'maxDepth'?");
}

// --- Several errors ------------------------------------------------------------------------------

TEST(Errors, OfSeveralElementsAreReportedTogether) {
  const std::string error = error_of(complete(R"(<shape type="torus"/>
<bsdf type="velvet" id="v"/>
<shape type="sphere"><ref id="v"/></shape>
<shape type="sphere"><float name="radius" value="-1"/></shape>)"));
  expect_contains(error, "scene.xml:2:1: unknown shape 'torus'");
  expect_contains(error, "scene.xml:3:1: unknown bsdf 'velvet'");
  expect_contains(error, "scene.xml:5:22: 'radius'");
  // The <ref> to the bsdf that could not be read is no error of its own.
  EXPECT_EQ(error.find("scene.xml:4"), std::string::npos) << error;
  expect_contains(error, "\n3 errors");
}

// A misspelt name may be why.
TEST(Errors, AreFollowedByWhatIsNotUsed) {
  const std::string error =
      error_of(complete(R"(<shape type="sphere"><float name="radious" value="1"/></shape>
<bsdf type="velvet"/>)"));
  expect_contains(error, "scene.xml:3:1: unknown bsdf 'velvet'");
  EXPECT_GT(error.find("besides:\n"), error.find("velvet"));
  expect_contains(error, "scene.xml:2:22: unknown property 'radious'");
}

TEST(Errors, OfUndefinedNamesAreAllReported) {
  const std::string error = error_of(lit(R"(<shape type="sphere">
<float name="radius" value="$size"/><point name="center" x="$x" y="0" z="$x"/></shape>)"));
  for (const char* name : {"'$size'", "'$x'"}) EXPECT_EQ(count(error, name), 1U) << error;
}

TEST(Errors, OfElementsThatAreReadAheadAreReportedOnce) {
  std::string scene = lit(R"(<shape type="sphere"><ref id="v"/></shape>
<shape type="disk"><ref id="v"/></shape><bsdf type="velvet" id="v"/>)");
  scene.replace(scene.find("0.6.0"), 5, "3.0.0");
  EXPECT_EQ(count(error_of(scene), "velvet"), 2U);  // the message and the line
}

TEST(Errors, AreNotCountedWithoutEnd) {
  std::string body;
  for (int i = 0; i < 300; ++i) body += "<shape type=\"torus\"/>\n";
  const std::string error = error_of(complete(body));
  EXPECT_EQ(count(error, "unknown shape"), 50U);
  expect_contains(error, "50 errors; what comes after them is not read");
}

TEST(Errors, OfDefinitionsNameTheNearest) {
  const SceneDirectory directory;
  const std::string error = test::scene_error([&] {
    directory.load(complete(R"(<default name="depth" value="1"/>)"),
                   {.defines = {{"depht", "3"}, {"wdith", "4"}}});
  });
  expect_contains(error, "'depht' is not used: the scene has no $depht; did you mean 'depth'?");
  expect_contains(error, "'wdith'");
}

// --- What else is told ---------------------------------------------------------------------------

TEST(LoadedScenes, KnowTheSamplesThatAreAskedFor) {
  const auto samples = [](const std::string& sampler) {
    const SceneDirectory directory;
    const LoadedScene loaded =
        directory.load(scene_file(R"(<sensor type="perspective">)" + sampler +
                                  R"(<film type="hdrfilm"/></sensor>)" + kEmitter + kShape));
    EXPECT_TRUE(loaded.notices.empty());
    return loaded.sample_count;
  };
  EXPECT_EQ(samples(""), std::nullopt);
  EXPECT_EQ(samples(R"(<sampler type="independent"/>)"), std::nullopt);
  EXPECT_EQ(samples(R"(<sampler type="independent"><integer name="sampleCount" value="48"/>
                       <integer name="seed" value="3"/></sampler>)"),
            48);
  EXPECT_EQ(samples(R"(<sampler type="independent"><integer name="sample_count" value="7"/>
                       </sampler>)"),
            7);
  expect_contains(error_of(scene_file(R"(<sensor type="perspective"><film type="hdrfilm"/>
      <sampler type="independent"><integer name="sampleCount" value="0"/></sampler></sensor>)" +
                                      kEmitter + kShape)),
                  "'sampleCount'");
}

TEST(LoadedScenes, KnowTheirFiles) {
  const SceneDirectory directory;
  directory.write("part.xml", scene_file(""));
  directory.write("grey.spd", "300 0.5\n900 0.5\n");
  directory.write("some.mtl", "newmtl a\n");
  directory.write("mesh.obj", "mtllib some.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
  const LoadedScene loaded = directory.load(lit(R"(<include filename="part.xml"/>
      <bsdf type="diffuse"><spectrum name="reflectance" filename="grey.spd"/></bsdf>
      <bsdf type="diffuse"><spectrum name="reflectance" filename="grey.spd"/></bsdf>
      <shape type="obj"><string name="filename" value="mesh.obj"/></shape>)"));
  std::vector<std::string> names;
  for (const auto& file : loaded.files) names.push_back(file.filename().string());
  EXPECT_EQ(names, (std::vector<std::string>{"scene.xml", "part.xml", "grey.spd", "mesh.obj",
                                             "some.mtl"}));
}

}  // namespace
}  // namespace driftlight
