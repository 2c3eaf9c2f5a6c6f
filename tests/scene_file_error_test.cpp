// SPDX-License-Identifier: Apache-2.0
/// Every class of bad scene is refused, at its place and naming what is wrong.
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>

#include "driftlight/scene_file.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::complete;
using test::kEmitter;
using test::kSensor;
using test::kShape;
using test::scene_file;
using test::SceneDirectory;

/// Loads a text with one '@', which is taken out. It must fail at the place of the '@', with all
/// the fragments in the message.
void expect_error(const SceneDirectory& directory, std::string text,
                  const std::vector<std::string>& fragments) {
  const std::size_t mark = text.find('@');
  const auto begin = text.begin();
  const auto end = begin + static_cast<std::ptrdiff_t>(mark);
  const auto line = 1 + std::count(begin, end, '\n');
  const auto column = static_cast<std::ptrdiff_t>(mark - (text.rfind('\n', mark) + 1)) + 1;
  text.erase(mark, 1);
  try {
    directory.load(text);
    ADD_FAILURE() << "loaded without an error:\n" << text;
  } catch (const SceneError& error) {
    const std::string message = error.what();
    EXPECT_EQ(error.location().line, line) << message;
    EXPECT_EQ(error.location().column, column) << message;
    EXPECT_EQ(message.find(to_string(error.location()) + ": "), 0U) << message;
    for (const std::string& fragment : fragments)
      EXPECT_NE(message.find(fragment), std::string::npos)
          << "no \"" << fragment << "\" in: " << message;
  }
}

/// A fault in the body of an otherwise complete scene; '@' marks where.
struct Fault {
  const char* name;
  const char* body;
  std::vector<std::string> fragments;
};

std::ostream& operator<<(std::ostream& stream, const Fault& fault) { return stream << fault.body; }

class BadScene : public ::testing::TestWithParam<Fault> {};

TEST_P(BadScene, IsRefusedAtItsPlace) {
  const SceneDirectory directory;
  const Fault& fault = GetParam();
  expect_error(directory, complete(fault.body), fault.fragments);
}

std::string name_of(const ::testing::TestParamInfo<Fault>& info) { return info.param.name; }

const Fault kFileFaults[] = {
    {"UnknownShape",
     R"(@<shape
 type="torus"/>)",
     {"shape 'torus'", "rectangle", "sphere"}},
    {"UnknownBsdf",
     R"(
  @<bsdf type="roughcondutcor"/>)",
     {"bsdf 'roughcondutcor'", "'roughconductor'"}},
    {"UnknownEmitter",
     R"(@<emitter type="collimated"/>)",
     {"emitter 'collimated'", "envmap", "spot"}},
    {"UnknownTexture", R"(@<texture type="wood"/>)", {"texture 'wood'", "bitmap"}},
    {"MisspeltAttribute",
     R"(<shape type="sphere">@<float name="radius" vlaue="1"/></shape>)",
     {"'vlaue'", "value"}},
    {"UnsupportedElement", R"(@<medium type="homogeneous"/>)", {"<medium>", "bsdf"}},
    {"MisspeltElement", R"(@<shap type="sphere"/>)", {"<shap>", "shape"}},
    {"UnsupportedChild",
     R"(<shape type="sphere">@<subsurface type="dipole"/></shape>)",
     {"<subsurface>", "shape 'sphere'"}},
    {"GivenTwice",
     R"(<shape type="sphere">)"
     R"(<float name="radius" value="1"/>
@<float name="radius" value="2"/></shape>)",
     {"'radius'", "twice"}},
    {"WrongTag",
     R"(<shape type="sphere">@<string name="radius" value="1"/></shape>)",
     {"'radius'", "<float>", "<string>"}},
    {"BadNumber",
     R"(<shape type="sphere">@<float name="radius" value="1x"/></shape>)",
     {"'1x'", "number"}},
    {"NotFinite",
     R"(<shape type="sphere">@<float name="radius" value="inf"/></shape>)",
     {"'inf'", "finite"}},
    {"EntitiesAreNotExpanded",
     R"(<shape type="sphere">@<float name="radius" value="&a;"/></shape>)",
     {"'&a;'"}},
    {"Negative",
     R"(<shape type="sphere">@<float name="radius" value="-1"/></shape>)",
     {"'radius'", "positive"}},
    {"BadBoolean",
     R"(<shape type="disk">@<boolean name="flipNormals" value="1"/></shape>)",
     {"'1'", "true or false"}},
    {"BadInteger",
     R"(<integrator type="path">@<integer name="maxDepth" value="1e9"/></integrator>)",
     {"depth"}},
    {"ZeroDepth",
     R"(<integrator type="path">@<integer name="maxDepth" value="0"/></integrator>)",
     {"positive"}},
    {"HiddenEmitters",
     R"(<integrator type="path">@<boolean name="hideEmitters" value="true"/>)"
     "</integrator>",
     {"hideEmitters"}},
    {"UndefinedName",
     R"(<shape type="sphere">@<float name="radius" value="$r1"/></shape>)",
     {"'$r1'", "<default>"}},
    {"UndefinedNameThatNobodyReads",
     R"(<integrator type="path">@<integer name="rrDepth" value="$n"/></integrator>)",
     {"'$n'"}},
    {"UnknownId",
     R"(<bsdf type="diffuse" id="a"/><shape type="sphere">@<ref id="b"/></shape>)",
     {"'b'", "valid are: a"}},
    {"ForwardReference",
     R"(<shape type="sphere">@<ref id="b"/></shape>
<bsdf type="diffuse" id="b"/>)",
     {"'b'", "further down", ":3:1"}},
    {"CyclicReference", R"(<bsdf type="twosided" id="b">@<ref id="b"/></bsdf>)", {"cyclic", "'b'"}},
    {"DuplicateId",
     R"(<bsdf type="diffuse" id="a"/>
@<bsdf type="phong" id="a"/>)",
     {"'a'", "taken"}},
    {"ReferenceOfTheWrongKind",
     R"(<shape type="disk" id="d"/><shape type="sphere">@<ref id="d"/></shape>)",
     {"'d' is not a bsdf"}},
    {"MissingInclude", R"(@<include filename="none.xml"/>)", {"none.xml"}},
    {"CyclicInclude", R"(@<include filename="scene.xml"/>)", {"cyclic", "scene.xml"}},
};
INSTANTIATE_TEST_SUITE_P(File, BadScene, ::testing::ValuesIn(kFileFaults), name_of);

const Fault kPluginFaults[] = {
    {"ThreeColors",
     R"(<bsdf type="diffuse">@<rgb name="reflectance" value="1, 2"/></bsdf>)",
     {"1 or 3 values"}},
    {"NegativeColor",
     R"(<bsdf type="diffuse">@<rgb name="reflectance" value="-1"/></bsdf>)",
     {"'-1'", "negative"}},
    {"BadHexadecimal",
     R"(<bsdf type="diffuse">@<rgb name="reflectance" value="#12345g"/></bsdf>)",
     {"'#12345g'"}},
    {"FallingWavelengths",
     R"(<bsdf type="diffuse">@<spectrum name="reflectance" value="500:1, 400:1"/></bsdf>)",
     {"400", "grow"}},
    {"OneWavelength",
     R"(<bsdf type="diffuse">@<spectrum name="reflectance" value="500:1"/></bsdf>)",
     {"two wavelengths"}},
    {"UnknownMetal",
     R"(<bsdf type="conductor">@<string name="material" value="Unobtainium"/></bsdf>)",
     {"'Unobtainium'", "the nearest of"}},
    {"UnknownIndex",
     R"(<bsdf type="dielectric">@<string name="intIOR" value="watter"/></bsdf>)",
     {"'watter'", "did you mean 'water'?"}},
    {"Anisotropy",
     R"(<bsdf type="roughplastic"><float name="alphaU" value="0.1"/>)"
     R"(@<float name="alphaV" value="0.2"/></bsdf>)",
     {"'alphaV'", "isotropic"}},
    {"HalfAnisotropy",
     R"(@<bsdf type="roughconductor"><float name="alphaU" value="0.1"/></bsdf>)",
     {"'alphaU' and 'alphaV' need each other"}},
    {"UnknownDistribution",
     R"(<bsdf type="roughconductor">@<string name="distribution" value="gauss"/></bsdf>)",
     {"'gauss'", "beckmann, ggx, phong"}},
    {"EqualIndices",
     R"(@<bsdf type="roughdielectric"><float name="intIOR" value="2"/>)"
     R"(<float name="extIOR" value="2"/></bsdf>)",
     {"differ"}},
    {"PlasticWithoutCoat",
     R"(@<bsdf type="plastic"><float name="intIOR" value="2"/>)"
     R"(<float name="extIOR" value="2"/></bsdf>)",
     {"differ"}},
    {"EmptyMask", R"(@<bsdf type="mask"/>)", {"one nested"}},
    {"MaskOfGlass",
     R"(<bsdf type="mask">@<bsdf type="dielectric"/></bsdf>)",
     {"dielectric", "thindielectric"}},
    {"OpacityAboveOne",
     R"(<bsdf type="mask"><boolean name="ensureEnergyConservation" value="false"/>)"
     R"(@<rgb name="opacity" value="2"/><bsdf type="diffuse"/></bsdf>)",
     {"'opacity'", "between 0 and 1"}},
    {"TwoSidedMask",
     R"(<bsdf type="twosided">@<bsdf type="mask"><bsdf type="diffuse"/></bsdf></bsdf>)",
     {"twosided", "transmission"}},
    {"TwoSidedGlass",
     R"(<bsdf type="twosided">@<bsdf type="dielectric"/></bsdf>)",
     {"twosided", "transmission"}},
    {"TwoSidedTwice",
     R"(<bsdf type="twosided">@<bsdf type="twosided"><bsdf type="phong"/></bsdf></bsdf>)",
     {"one-sided"}},
    {"BlendOfOne",
     R"(@<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="diffuse"/></bsdf>)",
     {"two nested bsdfs"}},
    {"BlendOfGlasses",
     R"(@<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="dielectric"/>)"
     R"(<bsdf type="thindielectric"/></bsdf>)",
     {"refract differently"}},
    {"BlendOfMaskAndGlass",
     R"(@<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="dielectric"/>)"
     R"(<bsdf type="mask"><bsdf type="diffuse"/></bsdf></bsdf>)",
     {"twosided or a mask"}},
    {"BlendOfTooMany",
     R"(@<bsdf type="mixturebsdf"><string name="weights" value="0.3, 0.3, 0.4"/>)"
     R"(<bsdf type="phong"/><bsdf type="roughplastic"/><bsdf type="diffuse"/></bsdf>)",
     {"5 diffuse and glossy lobes", "the limit is 4"}},
    {"MissingWeights",
     R"(<bsdf type="mixturebsdf">@<string name="weights" value="0.3"/>)"
     R"(<bsdf type="phong"/><bsdf type="diffuse"/></bsdf>)",
     {"1 weights for 2 nested"}},
    {"BumpMapWithoutTexture",
     R"(@<bsdf type="bumpmap"><bsdf type="diffuse"/></bsdf>)",
     {"needs a texture"}},
    {"NormalMapOfTwo",
     R"(<bsdf type="normalmap"><texture type="checkerboard"/><bsdf type="diffuse"/>)"
     R"(@<bsdf type="diffuse"/></bsdf>)",
     {"a second nested bsdf"}},
    {"BumpMapOfANormalMap",
     R"(@<bsdf type="bumpmap"><texture type="checkerboard"/><bsdf type="normalmap">)"
     R"(<texture type="checkerboard"/><bsdf type="diffuse"/></bsdf></bsdf>)",
     {"cannot be nested in each other"}},
    {"BlendOfABumpMap",
     R"(@<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="bumpmap">)"
     R"(<texture type="checkerboard"/><bsdf type="diffuse"/></bsdf><bsdf type="diffuse"/></bsdf>)",
     {"cannot be blended"}},
    {"BumpMapOnOneSide",
     R"(<bsdf type="twosided"><bsdf type="bumpmap">)"
     R"(<texture type="checkerboard"/><bsdf type="diffuse"/></bsdf>@<bsdf type="diffuse"/></bsdf>)",
     {"cannot differ by side"}},
    {"BumpMapOnASphere",
     R"(@<shape type="sphere"><bsdf type="bumpmap"><texture type="checkerboard"/>)"
     R"(<bsdf type="diffuse"/></bsdf></shape>)",
     {"need a mesh with texture coordinates"}},
    {"SunBelowTheHorizon",
     R"(@<emitter type="sky"><vector name="sunDirection" x="1" y="-0.1" z="0"/></emitter>)",
     {"below the horizon"}},
    {"SunTwice",
     R"(<emitter type="sun"><vector name="sunDirection" x="1" y="1" z="0"/>)"
     R"(@<float name="latitude" value="50"/></emitter>)",
     {"'latitude'", "sunDirection"}},
    {"Turbidity",
     R"(<emitter type="sunsky">@<float name="turbidity" value="11"/></emitter>)",
     {"'turbidity'", "1 and 10"}},
    {"TwoSidedNothing", R"(@<bsdf type="twosided"/>)", {"one or two"}},
    {"SingularTransform",
     R"(<shape type="sphere">@<transform name="toWorld"><scale x="0"/></transform>)"
     "</shape>",
     {"invertible"}},
    {"UnknownTransform",
     R"(<shape type="sphere"><transform name="toWorld">@<shear x="0"/></transform>)"
     "</shape>",
     {"<shear>", "lookat"}},
    {"ProjectiveMatrix",
     R"(<shape type="sphere"><transform name="toWorld">)"
     R"(@<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1"/></transform></shape>)",
     {"last row"}},
    {"ShortMatrix",
     R"(<shape type="sphere"><transform name="toWorld">@<matrix value="1 2 3"/>)"
     "</transform></shape>",
     {"16 numbers, not 3"}},
    {"StretchedSphere",
     R"(<shape type="sphere">@<transform name="toWorld"><scale x="2"/></transform>)"
     "</shape>",
     {"evenly"}},
    {"AreaWithoutShape", R"(@<emitter type="area"/>)", {"inside of a shape"}},
    {"PointInShape",
     R"(<shape type="sphere">@<emitter type="point"/></shape>)",
     {"'point'", "area"}},
    {"SecondEnvironment", R"(<emitter type="constant"/>@<emitter type="constant"/>)", {}},
    {"ShearedEnvironment",
     R"(<emitter type="envmap"><string name="filename" value="a.exr"/>)"
     R"(@<transform name="toWorld"><scale x="2"/></transform></emitter>)",
     {"rotation"}},
    {"ShearedSpot",
     R"(<emitter type="spot">@<transform name="toWorld"><scale y="2"/></transform></emitter>)",
     {"emitter 'spot'", "rotation"}},
    {"TexturedSpot",
     R"(<emitter type="spot">@<texture type="bitmap" name="texture"/></emitter>)",
     {"'texture'", "emitter 'spot'", "not supported"}},
    {"WideSpot",
     R"(<emitter type="spot">@<float name="cutoffAngle" value="181"/></emitter>)",
     {"'cutoffAngle'", "181", "180 degrees"}},
    {"SpotWithoutWidth",
     R"(<emitter type="spot">@<float name="cutoffAngle" value="0"/></emitter>)",
     {"'cutoffAngle'", "positive"}},
    {"BeamBeyondTheCutoff",
     R"(<emitter type="spot"><float name="cutoffAngle" value="30"/>)"
     R"(@<float name="beamWidth" value="31"/></emitter>)",
     {"'beamWidth'", "31", "30 degrees"}},
    {"DirectionTwice",
     R"(<emitter type="directional"><vector name="direction" x="0" y="0" z="1"/>)"
     R"(@<transform name="toWorld"/></emitter>)",
     {"'direction' or 'toWorld'"}},
    {"NoDirection",
     R"(<emitter type="directional">@<vector name="direction" x="0" y="0" z="0"/></emitter>)",
     {"'direction'", "zero"}},
    {"DirectionAsAPoint",
     R"(<emitter type="directional">@<point name="direction" x="0" y="0" z="1"/></emitter>)",
     {"<vector>", "<point>"}},
    {"MissingImage",
     R"(@<emitter type="envmap"><string name="filename" value="none.exr"/></emitter>)",
     {"none.exr"}},
    {"MissingFilename", R"(@<texture type="bitmap"/>)", {"'filename'"}},
    {"MissingMesh",
     R"(@<shape type="obj"><string name="filename" value="none.obj"/></shape>)",
     {"none.obj", "opened"}},
};
INSTANTIATE_TEST_SUITE_P(Plugins, BadScene, ::testing::ValuesIn(kPluginFaults), name_of);

/// Faults of the sensor.
class BadSensor : public ::testing::TestWithParam<Fault> {};

TEST_P(BadSensor, IsRefusedAtItsPlace) {
  const SceneDirectory directory;
  const Fault& fault = GetParam();
  expect_error(directory, scene_file(fault.body + kEmitter + kShape), fault.fragments);
}

const Fault kSensorFaults[] = {
    {"UnknownSensor", R"(@<sensor type="fisheye"/>)", {"'fisheye'", "perspective"}},
    {"TwoFilms",
     R"(<sensor type="perspective"><film type="hdrfilm"/>@<film type="hdrfilm"/></sensor>)",
     {"second film"}},
    {"UnknownFilter",
     R"(<sensor type="perspective"><film type="hdrfilm">@<rfilter type="gauss"/>)"
     "</film></sensor>",
     {"rfilter 'gauss'", "box", "gaussian"}},
    {"WideFilter",
     R"(<sensor type="perspective"><film type="hdrfilm"><rfilter type="gaussian">)"
     R"(@<float name="stddev" value="5"/></rfilter></film></sensor>)",
     {"'stddev'", "radius 20", "0.1 and 16"}},
    {"TwoFilters",
     R"(<sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/>@<rfilter type="box"/>)"
     "</film></sensor>",
     {"second rfilter"}},
    {"Crop",
     R"(<sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/>)"
     R"(<integer name="width" value="8"/><integer name="cropOffsetX" value="2"/>)"
     R"(@<integer name="cropWidth" value="7"/></film></sensor>)",
     {"'cropWidth'", "from pixel 2 to 9 of a film of 8"}},
    {"HugeFilm",
     R"(<sensor type="perspective">@<film type="hdrfilm"><rfilter type="box"/>)"
     R"(<integer name="width" value="2000000000"/></film></sensor>)",
     {"too large"}},
    {"OverflowingFilm",
     R"(<sensor type="perspective"><film type="hdrfilm">)"
     R"(@<integer name="width" value="3000000000"/></film></sensor>)",
     {"'3000000000'", "integer"}},
    {"FieldOfView",
     R"(<sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/></film>)"
     R"(@<float name="fov" value="180"/></sensor>)",
     {"'fov'"}},
    {"ScaledSensor",
     R"(<sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/></film>)"
     R"(@<transform name="toWorld"><scale value="2"/></transform></sensor>)",
     {"scale"}},
    {"ScaledOrthographicSensor",
     R"(<sensor type="orthographic"><film type="hdrfilm"/>)"
     R"(@<transform name="toWorld"><matrix value="1 1 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform>)"
     "</sensor>",
     {"shear"}},
    {"LensWithoutRadius",
     R"(@<sensor type="thinlens"><film type="hdrfilm"/></sensor>)",
     {"'thinlens'", "apertureRadius"}},
    {"NegativeLens",
     R"(<sensor type="thinlens"><film type="hdrfilm"/>@<float name="apertureRadius" value="-1"/>)"
     "</sensor>",
     {"'apertureRadius'"}},
    {"ClipPlanes",
     R"(<sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/></film>)"
     R"(@<float name="nearClip" value="5"/><float name="farClip" value="5"/></sensor>)",
     {"'nearClip'", "farClip"}},
};
INSTANTIATE_TEST_SUITE_P(All, BadSensor, ::testing::ValuesIn(kSensorFaults), name_of);

TEST(BadSceneFile, Missing) {
  const SceneDirectory directory;
  try {
    load_scene(directory.path() / "absent.xml");
    FAIL() << "loaded a file that does not exist";
  } catch (const SceneError& error) {
    EXPECT_NE(std::string(error.what()).find("absent.xml: "), std::string::npos) << error.what();
  }
}

TEST(BadSceneFile, Malformed) {
  const SceneDirectory directory;
  expect_error(directory, "<scene version=\"0.6.0\">\n<shape type=\"sphere\">\n</@scene>\n",
               {"not well-formed"});
  expect_error(directory, "@", {"not well-formed"});
}

TEST(BadSceneFile, ColumnsCountCharacters) {
  const SceneDirectory directory;
  const std::string umlaut_and_euro = "<!-- \xC3\xA4\xE2\x82\xAC -->";
  try {
    directory.load(complete(umlaut_and_euro + "<bsdf type=\"velvet\"/>"));
    FAIL() << "loaded an unknown bsdf";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.location().column, 12) << error.what();
  }
}

TEST(BadSceneFile, NotAScene) {
  const SceneDirectory directory;
  expect_error(directory, "@<html/>", {"<scene>"});
  expect_error(directory, "<scene version=\"0.6.0\"/>\n@<scene/>", {"second"});
  expect_error(directory, "@<scene/>", {"'version'"});
  expect_error(directory, "@<scene version=\"1.0.0\"/>", {"'1.0.0'", "0.6.x", "3.x.x"});
}

TEST(BadSceneFile, LacksAPart) {
  const SceneDirectory directory;
  expect_error(directory, "@" + scene_file(kShape + kEmitter), {"no sensor"});
  expect_error(directory, "@" + scene_file(kSensor + kEmitter), {"no shape"});
  expect_error(directory, "@" + scene_file(kSensor + kShape), {"no emitter"});
}

TEST(BadSceneFile, SecondSensor) {
  const SceneDirectory directory;
  expect_error(directory, scene_file(kSensor + "\n  @" + kSensor + kShape + kEmitter),
               {"second sensor"});
}

TEST(BadSceneFile, UnusedDefinition) {
  const SceneDirectory directory;
  try {
    directory.load(complete(""), {{{"depht", "3"}}});
    FAIL() << "accepted a definition that nothing uses";
  } catch (const SceneError& error) {
    EXPECT_NE(std::string(error.what()).find("scene.xml: the definition of 'depht'"),
              std::string::npos)
        << error.what();
  }
  // A <default> says that the scene knows the name, whether or not it needs it.
  EXPECT_NO_THROW(
      directory.load(complete("<default name=\"depth\" value=\"1\"/>"), {{{"depth", "3"}}}));
}

TEST(BadSceneFile, NestedWithoutEnd) {
  const SceneDirectory directory;
  std::string body;
  for (int i = 0; i < 100'000; ++i) body += "<bsdf type=\"twosided\">";
  for (int i = 0; i < 100'000; ++i) body += "</bsdf>";
  try {
    directory.load(complete(body));
    FAIL() << "loaded 100000 levels";
  } catch (const SceneError& error) {
    EXPECT_NE(std::string(error.what()).find("levels deep"), std::string::npos) << error.what();
  }
}

TEST(BadSceneFile, BillionLaughs) {
  const SceneDirectory directory;
  expect_error(directory,
               R"(<!DOCTYPE scene [<!ENTITY a "1"><!ENTITY b "&a;&a;">]>)" +
                   complete(R"(<shape type="sphere">@<float name="radius" value="&b;"/></shape>)"),
               {"'&b;'", "number"});
}

TEST(BadSceneFile, ErrorsInIncludesNameTheirFile) {
  const SceneDirectory directory;
  directory.write("part.xml", scene_file("<bsdf type=\"velvet\"/>"));
  try {
    directory.load(complete("<include filename=\"part.xml\"/>"));
    FAIL() << "loaded an unknown bsdf";
  } catch (const SceneError& error) {
    EXPECT_NE(std::string(error.what()).find("part.xml:2:1: "), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace driftlight
