// SPDX-License-Identifier: Apache-2.0
/// The dialect of Mitsuba 3, and what both dialects name: ids, files and substitutes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "driftlight/scene_file.h"
#include "scene_file/dialect.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::complete;
using test::expect_contains;
using test::expect_near;
using test::kEmitter;
using test::kSensor;
using test::kShape;
using test::lit;
using test::SceneDirectory;

std::string mitsuba3(const std::string& body) {
  return "<scene version=\"3.0.0\">\n" + body + "\n</scene>\n";
}

/// A scene of the newer dialect: the body, a sensor and an emitter.
std::string lit3(const std::string& body) { return mitsuba3(body + kSensor + kEmitter); }

std::string error_of(const std::string& scene) {
  const SceneDirectory directory;
  return test::scene_error([&] { directory.load(scene); });
}

Bsdf first_bsdf(const std::string& scene) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(scene);
  return loaded.scene.bsdfs()[0];
}

TEST(Dialect, SpellsNames) {
  EXPECT_EQ(snake_case("toWorld"), "to_world");
  EXPECT_EQ(snake_case("intIOR"), "int_ior");
  EXPECT_EQ(snake_case("wrapModeU"), "wrap_mode_u");
  EXPECT_EQ(snake_case("to_world"), "to_world");
  EXPECT_EQ(snake_case("uvscale"), "uvscale");
  EXPECT_EQ(spelling("fovAxis", Dialect::Mitsuba06), "fovAxis");
  EXPECT_EQ(spelling("fovAxis", Dialect::Mitsuba3), "fov_axis");
}

TEST(Dialect, FollowsTheVersion) {
  EXPECT_EQ(dialect_of("0.5.0"), Dialect::Mitsuba06);
  EXPECT_EQ(dialect_of("0.6.0"), Dialect::Mitsuba06);
  EXPECT_EQ(dialect_of("2.1.0"), Dialect::Mitsuba3);
  EXPECT_EQ(dialect_of("3.5.2"), Dialect::Mitsuba3);
  EXPECT_EQ(dialect_of("1.0.0"), std::nullopt);
  EXPECT_EQ(dialect_of(""), std::nullopt);
}

TEST(Dialect, ReadsAWholeSceneOfMitsuba3) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(mitsuba3(R"(
    <default name="depth" value="7"/>
    <integrator type="path"><integer name="max_depth" value="$depth"/>
      <integer name="rr_depth" value="5"/><boolean name="hide_emitters" value="false"/></integrator>
    <sensor type="perspective">
      <string name="fov_axis" value="y"/><float name="fov" value="60"/>
      <float name="near_clip" value="2"/><float name="far_clip" value="50"/>
      <float name="principal_point_offset_x" value="0"/>
      <transform name="to_world"><lookat origin="1, 2, 3" target="1, 2, -5" up="0, 3, 1"/>
      </transform>
      <film type="hdrfilm"><integer name="width" value="200"/><integer name="height" value="100"/>
        <string name="pixel_format" value="rgb"/><string name="component_format" value="float32"/>
        <boolean name="sample_border" value="true"/><rfilter type="box"/></film>
    </sensor>
    <shape type="sphere"><point name="center" value="1, 0, 0"/><boolean name="flip_normals"
      value="true"/><transform name="to_world"><scale value="3"/><translate value="0, 0, 1"/>
      <rotate value="0, 0, 1" angle="90"/></transform>
      <bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/>
        <rgb name="specular_transmittance" value="0.5"/></bsdf></shape>
    <emitter type="spot"><float name="cutoff_angle" value="30"/><float name="beam_width"
      value="12"/><float name="intensity" value="2"/></emitter>)"));
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "rr_depth of integrator 'path' is not used");
  EXPECT_EQ(loaded.max_depth, 7);
  const Camera& camera = loaded.scene.camera();
  expect_near(camera.forward, Vec3d(0, 0, -1));
  EXPECT_NEAR(camera.half_height, std::tan(kPi / 6.0), 1e-12);
  EXPECT_EQ(camera.near_clip, 2);
  // The center is scaled, too.
  const auto& sphere = std::get<Sphere>(loaded.scene.shapes()[0].geometry);
  expect_near(sphere.center, Vec3d(0, 3, 1));
  EXPECT_NEAR(sphere.radius, 3.0, 1e-12);
  EXPECT_TRUE(sphere.flip_normals);
  const auto& glass = std::get<Dielectric>(loaded.scene.bsdfs()[0]);
  EXPECT_EQ(glass.eta, 1.5);
  expect_near(glass.specular_transmittance.color, Rgbd(0.5, 0.5, 0.5));
  const auto& spot = std::get<SpotEmitter>(loaded.scene.emitters()[0]);
  EXPECT_NEAR(spot.beam_width(), kPi / 15.0, 1e-12);
  expect_near(spot.intensity(), Rgbd(2, 2, 2));
}

TEST(Dialect, ReadsAThinLensOfMitsuba3) {
  const SceneDirectory directory;
  const std::string lens = R"(<sensor type="thinlens"><float name="fov" value="60"/>
    <float name="aperture_radius" value="0.3"/><float name="focus_distance" value="7"/>
    <film type="hdrfilm"/></sensor>)";
  const LoadedScene loaded = directory.load(mitsuba3(lens + kShape + kEmitter));
  EXPECT_EQ(loaded.scene.camera().lens_radius, 0.3);
  EXPECT_EQ(loaded.scene.camera().focus_depth, 7);
}

TEST(Dialect, MessagesSpellNamesAsTheFileDoes) {
  const auto notice = [](const std::string& content) {
    const SceneDirectory directory;
    return directory.load(content).notices.at(0);
  };
  const std::string unknown =
      notice(lit3(R"(<shape type="sphere"><float name="to_wrold" value="1"/></shape>)"));
  expect_contains(unknown, "'to_wrold'");
  expect_contains(unknown, "'to_world'");
  EXPECT_EQ(unknown.find("toWorld"), std::string::npos) << unknown;
  expect_contains(notice(lit(R"(<shape type="sphere"><float name="radius" value="1"/>
                                <float name="flip" value="1"/></shape>)")),
                  "flipNormals");
  expect_contains(error_of(lit3(R"(<shape type="sphere"><boolean name="flip_normals" value="true"/>
                                   <boolean name="flipNormals" value="true"/></shape>)")),
                  "'flipNormals' is given twice");
}

TEST(Dialect, AMetalWithoutANameReflectsAllInMitsuba3) {
  const std::string shape = R"(<shape type="sphere"><bsdf type="roughconductor"/></shape>)";
  const auto mirror = std::get<RoughConductor>(first_bsdf(lit3(shape)));
  expect_near(mirror.eta, Rgbd(0, 0, 0));
  const auto copper = std::get<RoughConductor>(first_bsdf(lit(shape)));
  EXPECT_GT(copper.eta.minCoeff(), 0.0);
}

TEST(Dialect, Mitsuba3TakesTheFirstOfSeveralSensors) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit3(kShape + kSensor));
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "sensor");
}

TEST(Dialect, MetalsAreNotInAirInMitsuba3) {
  const std::string shape =
      R"(<shape type="sphere"><bsdf type="conductor"><string name="material" value="Au"/></bsdf>
         </shape>)";
  const auto older = std::get<Conductor>(first_bsdf(lit(shape)));
  const auto newer = std::get<Conductor>(first_bsdf(lit3(shape)));
  expect_near(newer.eta, Rgbd(1.000277 * older.eta));
  expect_near(newer.k, Rgbd(1.000277 * older.k));
}

TEST(Dialect, OpacityIsOneNumberInMitsuba3) {
  const std::string shape =
      R"(<shape type="sphere"><bsdf type="mask"><rgb name="opacity" value="1, 0.5, 0"/>
         <bsdf type="diffuse"/></bsdf></shape>)";
  expect_near(std::get<Mask>(first_bsdf(lit(shape))).opacity.color, Rgbd(1, 0.5, 0));
  const double expected = luminance<double>(Rgbd(1, 0.5, 0));
  expect_near(std::get<Mask>(first_bsdf(lit3(shape))).opacity.color,
              Rgbd(Rgbd::Constant(expected)));
  const SceneDirectory directory;
  const LoadedScene full = directory.load(
      lit3(R"(<shape type="sphere"><bsdf type="mask"><float name="opacity" value="3"/>
              <bsdf type="diffuse"/></bsdf></shape>)"));
  expect_near(std::get<Mask>(full.scene.bsdfs()[0]).opacity.color, Rgbd(1, 1, 1));
  ASSERT_EQ(full.notices.size(), 1U);
  expect_contains(full.notices[0], "'opacity'");
}

TEST(Dialect, OnlyMitsuba06HasADefaultWeight) {
  expect_contains(error_of(lit3(R"(<shape type="sphere"><bsdf type="blendbsdf">
                                   <bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf></shape>)")),
                  "'weight'");
}

TEST(Dialect, Mitsuba3FlipsAndShadowsNormals) {
  const SceneDirectory directory;
  for (const std::string type : {"bumpmap", "normalmap"}) {
    const auto notices = [&](const std::string& content, bool newer) {
      const std::string shape = R"(<shape type="rectangle"><bsdf type=")" + type +
                                R"("><texture type="checkerboard"/><bsdf type="diffuse"/>)" +
                                content + "</bsdf></shape>";
      return directory.load(newer ? lit3(shape) : lit(shape)).notices;
    };
    EXPECT_TRUE(notices("", false).empty());
    ASSERT_EQ(notices("", true).size(), 2U);
    expect_contains(notices("", true)[0], "flip_invalid_normals");
    expect_contains(notices("", true)[1], "use_shadowing_function");
    EXPECT_TRUE(notices(R"(<boolean name="flip_invalid_normals" value="false"/>
                           <boolean name="use_shadowing_function" value="False"/>)",
                        true)
                    .empty());
  }
}

TEST(Dialect, Mitsuba3HasLooserTypes) {
  const std::string loose =
      R"(<shape type="sphere"><vector name="center" value="1, 2, 3"/>
         <boolean name="flip_normals" value="True"/></shape>)";
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit3(loose));
  const auto& sphere = std::get<Sphere>(loaded.scene.shapes()[0].geometry);
  expect_near(sphere.center, Vec3d(1, 2, 3));
  EXPECT_TRUE(sphere.flip_normals);
  expect_contains(
      error_of(lit(R"(<shape type="sphere"><vector name="center" x="1" y="2" z="3"/></shape>)")),
      "<point>");
  expect_contains(
      error_of(lit(R"(<shape type="sphere"><boolean name="flipNormals" value="True"/></shape>)")),
      "'True'");
}

TEST(Dialect, Mitsuba3HasSmallMatrices) {
  const auto shape = [](const std::string& name) {
    return R"(<shape type="sphere"><transform name=")" + name +
           R"("><matrix value="0 -2 0  2 0 0  0 0 2"/><translate x="5"/></transform></shape>)";
  };
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit3(shape("to_world")));
  const auto& sphere = std::get<Sphere>(loaded.scene.shapes()[0].geometry);
  expect_near(sphere.center, Vec3d(5, 0, 0));
  EXPECT_NEAR(sphere.radius, 2.0, 1e-12);
  expect_near(Vec3d(sphere.to_local.row(0)), Vec3d(0, 1, 0));
  expect_contains(error_of(lit(shape("toWorld"))), "16 numbers");
}

TEST(Dialect, TwoSidedGlassOfMitsuba3IsRefused) {
  const auto shape = [](const std::string& bsdf) {
    return lit3(R"(<shape type="sphere"><bsdf type="twosided">
                   <boolean name="allow_transmission" value="true"/><bsdf type=")" +
                bsdf + R"("/></bsdf></shape>)");
  };
  EXPECT_TRUE(std::holds_alternative<Diffuse>(first_bsdf(shape("diffuse"))));
  expect_contains(error_of(shape("dielectric")), "transmission");
}

// --- Ids -----------------------------------------------------------------------------------------

const std::string kRedShape = R"(<shape type="sphere"><ref id="red"/></shape>)";
const std::string kRed =
    R"(<bsdf type="diffuse" id="red"><ref id="paint" name="reflectance"/></bsdf>)";

TEST(Ids, Mitsuba3RefersToWhatStandsFurtherDown) {
  const std::string shapes = kRedShape + kRedShape +
                             R"(<bsdf type="twosided" id="red"><ref id="inner"/></bsdf>
      <bsdf type="diffuse" id="inner"><rgb name="reflectance" value="0.9, 0, 0"/></bsdf>)";
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit3(shapes));
  EXPECT_EQ(loaded.scene.materials().size(), 1U);
  expect_near(std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance.color, Rgbd(0.9, 0, 0));
  expect_contains(error_of(lit(shapes)), "further down");
}

TEST(Ids, CirclesAreRefused) {
  expect_contains(error_of(lit3(kRedShape + R"(<bsdf type="twosided" id="red"><ref id="b"/></bsdf>
      <bsdf type="twosided" id="b"><ref id="red"/></bsdf>)")),
                  "cyclic reference");
  expect_contains(
      error_of(lit3(kRedShape + R"(<bsdf type="twosided" id="red"><ref id="red"/></bsdf>)")),
      "cyclic reference");
}

TEST(Ids, ARefOfTheWrongKindStaysAnError) {
  expect_contains(error_of(lit3(kRedShape + R"(<shape type="disk" id="red"/>)")), "'red'");
}

TEST(Ids, ShapesReferToAreaEmittersInMitsuba3) {
  const std::string lamp =
      R"(<emitter type="area" id="lamp"><rgb name="radiance" value="1, 2, 3"/></emitter>)";
  const std::string shape = R"(<shape type="sphere"><ref id="lamp"/></shape>)";
  const SceneDirectory directory;
  for (const std::string& body : {lamp + shape, shape + lamp}) {
    const LoadedScene loaded = directory.load(mitsuba3(body + kSensor));
    ASSERT_EQ(loaded.scene.emitters().size(), 1U);
    expect_near(std::get<AreaEmitter>(loaded.scene.emitters()[0]).radiance, Rgbd(1, 2, 3));
  }
  expect_contains(error_of(mitsuba3(lamp + kShape + kSensor)), "no emitter");
  expect_contains(error_of(lit(lamp)), "inside of a shape");
}

TEST(Ids, AliasesAreSecondNames) {
  const std::string definition = R"(<bsdf type="diffuse" id="a"/><alias id="a" as="red"/>)";
  const SceneDirectory directory;
  EXPECT_EQ(directory.load(lit(definition + kRedShape)).scene.bsdfs().size(), 1U);
  expect_contains(error_of(lit(R"(<alias id="none" as="red"/>)")), "nothing has the id 'none'");
  expect_contains(error_of(lit(definition + R"(<alias id="a" as="red"/>)")), "already taken");
}

// --- Files ---------------------------------------------------------------------------------------

TEST(Files, AreLookedForInPathsAndBesideTheFileThatNamesThem) {
  const SceneDirectory directory;
  std::filesystem::create_directories(directory.path() / "meshes");
  std::filesystem::create_directories(directory.path() / "parts");
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  directory.write("meshes/a.obj", triangle);
  directory.write("parts/b.obj", triangle);
  const auto mesh = [](const std::string& file) {
    return R"(<shape type="obj"><string name="filename" value=")" + file + R"("/></shape>)";
  };
  directory.write("parts/part.xml", mitsuba3(mesh("b.obj")));
  const LoadedScene loaded = directory.load(
      lit3(R"(<path value="meshes"/><include filename="parts/part.xml"/>)" + mesh("a.obj")));
  EXPECT_EQ(loaded.scene.shapes().size(), 2U);
  expect_contains(error_of(lit3(R"(<path value="absent"/>)")), "absent");
}

/// A file of Mitsuba 3 with this outermost element.
std::string outermost3(std::string element) {
  return element.insert(element.find_first_of(" >"), " version=\"3.0.0\"");
}

TEST(Includes, MayBeOneObjectInMitsuba3) {
  const SceneDirectory directory;
  directory.write("red.xml", outermost3(R"(<bsdf type="diffuse" id="red">
      <rgb name="reflectance" value="0.9, 0, 0"/></bsdf>)"));
  const std::string body = R"(<include filename="red.xml"/>)" + kRedShape;
  const LoadedScene loaded = directory.load(lit3(body));
  expect_near(std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance.color, Rgbd(0.9, 0, 0));
  expect_contains(test::scene_error([&] { directory.load(lit(body)); }), "must be <scene>");
  directory.write("red.xml", outermost3("<point name=\"p\"/>"));
  expect_contains(test::scene_error([&] { directory.load(lit3(body)); }), "an object such as");
}

TEST(Includes, MayStandInObjectsInMitsuba3) {
  const SceneDirectory directory;
  std::filesystem::create_directories(directory.path() / "parts");
  directory.write("parts/paint.xml", outermost3(R"(<texture type="checkerboard">
      <rgb name="color0" value="0.9"/></texture>)"));
  directory.write("parts/painted.xml", outermost3(R"(<bsdf type="diffuse">
      <include name="reflectance" filename="paint.xml"/></bsdf>)"));
  directory.write(
      "parts/lamp.xml",
      mitsuba3(R"(<emitter type="area"><rgb name="radiance" value="$power"/></emitter>)"));
  directory.write("film.xml", outermost3(R"(<film type="hdrfilm"><integer name="width" value="20"/>
      <rfilter type="box"/></film>)"));
  const LoadedScene loaded = directory.load(mitsuba3(
      R"(<default name="power" value="4"/>
         <shape type="rectangle"><include filename="parts/painted.xml"/>
           <include filename="parts/lamp.xml"/></shape>
         <sensor type="perspective"><include filename="film.xml"/></sensor>)"));
  EXPECT_EQ(loaded.scene.camera().film_width, 20);
  const Texture& paint = std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance;
  ASSERT_TRUE(paint.pattern.has_value());
  expect_near(paint.pattern->color0, Rgbd(0.9, 0.9, 0.9));
  expect_near(std::get<AreaEmitter>(loaded.scene.emitters()[0]).radiance, Rgbd(4, 4, 4));
}

TEST(Includes, InObjectsSayWhatIsWrong) {
  const SceneDirectory directory;
  const auto error = [&](const std::string& part) {
    directory.write("part.xml", part);
    return test::scene_error([&] {
      directory.load(lit3(R"(<shape type="sphere"><include filename="part.xml"/></shape>)"));
    });
  };
  expect_contains(
      error(outermost3(R"(<bsdf type="twosided"><include filename="part.xml"/></bsdf>)")),
      "cyclic");
  expect_contains(error(mitsuba3(R"(<float name="radius" value="2"/>)")),
                  "part.xml:2:1: <float> is not supported");
  expect_contains(error(outermost3(R"(<bsdf type="velvet"/>)")), "part.xml:1:1: ");
  expect_contains(error(R"(<bsdf type="diffuse"/>)"), "'version'");
  std::string deep = R"(<bsdf type="diffuse"/>)";
  for (int i = 0; i < 30; ++i) deep = R"(<bsdf type="mask">)" + deep + "</bsdf>";
  expect_contains(error(outermost3(deep)), "levels deep");
  expect_contains(error_of(lit(R"(<shape type="sphere"><include filename="part.xml"/></shape>)")),
                  "<include>");
}

// --- Colours -------------------------------------------------------------------------------------

Rgbd reflectance(const std::string& element, bool newer) {
  const std::string shape =
      R"(<shape type="sphere"><bsdf type="diffuse">)" + element + "</bsdf></shape>";
  return std::get<Diffuse>(first_bsdf(newer ? lit3(shape) : lit(shape))).reflectance.color;
}

TEST(Spectra, ReflectDaylightInMitsuba3) {
  const std::string flat = R"(<spectrum name="reflectance" value="300:0.5, 900:0.5"/>)";
  expect_near(reflectance(flat, true), Rgbd(0.5, 0.5, 0.5), 1e-3);
  expect_near(reflectance(flat, false), Rgbd(0.6024, 0.4742, 0.4547), 1e-3);
}

TEST(Spectra, AreLightInEmitters) {
  const auto radiance = [](const std::string& element, bool newer) {
    const std::string emitter = R"(<emitter type="constant">)" + element + "</emitter>";
    const SceneDirectory directory;
    const LoadedScene loaded = directory.load(newer ? mitsuba3(emitter + kSensor + kShape)
                                                    : test::with_sensor(emitter + kShape));
    return std::get<ConstantEnvironment>(loaded.scene.emitters()[0]).radiance;
  };
  const Rgbd pink(1.2049, 0.9483, 0.9093);
  const std::string list = R"(<spectrum name="radiance" value="300:1, 900:1"/>)";
  expect_near(radiance(list, true), pink, 1e-3);
  const std::string uniform = R"(<spectrum name="radiance" value="2"/>)";
  expect_near(radiance(uniform, true), Rgbd(2.0 * pink), 1e-3);
  expect_near(radiance(uniform, false), Rgbd(2, 2, 2));
  expect_near(radiance(R"(<rgb name="radiance" value="2"/>)", true), Rgbd(2, 2, 2));
  // A black body of 5000 K peaks at 12.8 kW / (m^2 sr nm); it is yellowish, and 6504 K nearly
  // white.
  const Rgbd warm = radiance(R"(<blackbody name="radiance" temperature="5000K"/>)", false);
  EXPECT_GT(luminance<double>(warm), 10e3);
  EXPECT_LT(luminance<double>(warm), 12.8e3);
  EXPECT_GT(warm.x(), warm.y());
  EXPECT_GT(warm.y(), warm.z());
  const Rgbd white = radiance(
      R"(<spectrum type="blackbody" name="radiance"><float name="temperature" value="6504"/>
         </spectrum>)",
      true);
  EXPECT_NEAR(white.x() / white.y(), 1.0, 0.08);
  EXPECT_NEAR(white.z() / white.y(), 1.0, 0.08);
  expect_near(radiance(R"(<blackbody name="radiance" temperature="5000" scale="2"/>)", false),
              Rgbd(2.0 * warm), 1e-6);
}

TEST(Spectra, HaveTypesInMitsuba3) {
  expect_near(reflectance(R"(<spectrum type="uniform" name="reflectance">
      <float name="value" value="0.3"/></spectrum>)",
                          true),
              Rgbd(0.3, 0.3, 0.3));
  expect_near(reflectance(R"(<spectrum type="regular" name="reflectance">
      <float name="wavelength_min" value="300"/><float name="wavelength_max" value="900"/>
      <string name="values" value="0.5, 0.5, 0.5"/></spectrum>)",
                          true),
              Rgbd(0.5, 0.5, 0.5), 1e-3);
  expect_near(reflectance(R"(<spectrum type="irregular" name="reflectance">
      <string name="wavelengths" value="300, 400, 900"/>
      <string name="values" value="0.5, 0.5, 0.5"/></spectrum>)",
                          true),
              Rgbd(0.5, 0.5, 0.5), 1e-3);
  expect_near(reflectance(R"(<float name="reflectance" value="0.25"/>)", true),
              Rgbd(0.25, 0.25, 0.25));
}

TEST(Spectra, AreReadFromFiles) {
  const SceneDirectory directory;
  directory.write("grey.spd", "# nm value\n300 0.5\n\n900 0.5  # the end\n");
  const auto color = [&](const std::string& file) {
    const LoadedScene loaded = directory.load(lit3(
        R"(<shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" filename=")" +
        file + R"("/></bsdf></shape>)"));
    return std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance.color;
  };
  expect_near(color("grey.spd"), Rgbd(0.5, 0.5, 0.5), 1e-3);
  directory.write("bad.spd", "300 0.5 1\n");
  EXPECT_THROW(color("bad.spd"), SceneError);
  EXPECT_THROW(color("absent.spd"), SceneError);
}

// Mitsuba 0.5 interpolated from the wrong ends: here a line that rises from 400 to 700 nm falls.
TEST(Spectra, AreBackwardsInFilesBefore06) {
  const auto load = [](const std::string& version, const std::string& value) {
    std::string file = complete(R"(<shape type="sphere"><bsdf type="diffuse">
        <spectrum name="reflectance" value=")" +
                                value + R"("/></bsdf></shape>)");
    file.replace(file.find("0.6.0"), 5, version);
    return SceneDirectory().load(file);
  };
  const auto color = [](const LoadedScene& loaded) {
    return std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance.color;
  };
  const std::string list = "399.9:0, 400:0.1, 700:0.7, 700.1:0";
  const LoadedScene forward = load("0.6.0", list);
  const LoadedScene backward = load("0.5.0", list);
  expect_near(color(backward), color(load("0.6.0", "399.9:0, 400:0.7, 700:0.1, 700.1:0")), 1e-3);
  EXPECT_GT(color(forward).x(), color(backward).x());
  EXPECT_TRUE(forward.notices.empty());
  ASSERT_EQ(backward.notices.size(), 1U);
  expect_contains(backward.notices[0], "Mitsuba 0.5");
  EXPECT_TRUE(load("0.5.0", "0.5").notices.empty());
}

TEST(Spectra, SayWhatIsWrong) {
  const auto bad = [](const std::string& element) {
    return error_of(
        lit3(R"(<shape type="sphere"><bsdf type="diffuse">)" + element + "</bsdf></shape>"));
  };
  expect_contains(bad(R"(<spectrum name="reflectance"/>)"), "'value' or 'filename'");
  expect_contains(bad(R"(<spectrum type="lamp" name="reflectance"/>)"), "irregular");
  expect_contains(bad(R"(<spectrum type="irregular" name="reflectance">
      <string name="wavelengths" value="300"/><string name="values" value="1, 2"/></spectrum>)"),
                  "as many");
  expect_contains(bad(R"(<blackbody name="reflectance" temperature="0K"/>)"), "kelvin");
}

// --- What is replaced ----------------------------------------------------------------------------

TEST(Substitutes, AreNamed) {
  const auto notices = [](const std::string& film_content, const std::string& sensor_content) {
    const SceneDirectory directory;
    const std::string sensor = R"(<sensor type="perspective">)" + sensor_content +
                               R"(<film type="hdrfilm">)" + film_content + "</film></sensor>";
    return directory.load(test::scene_file(sensor + kEmitter + kShape)).notices;
  };
  EXPECT_TRUE(notices(R"(<rfilter type="box"/>)", "").empty());
  const std::vector<std::string> sampler =
      notices(R"(<rfilter type="box"/>)",
              R"(<sampler type="ldsampler"><integer name="sampleCount" value="48"/></sampler>)");
  ASSERT_EQ(sampler.size(), 1U);
  expect_contains(sampler[0], "sampler 'ldsampler'");
}

TEST(Substitutes, NestedIntegratorsGiveTheirDepth) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(mitsuba3(R"(<integrator type="aov">
      <integrator type="path"><integer name="max_depth" value="6"/></integrator></integrator>)" +
                                                     kSensor + kEmitter + kShape));
  EXPECT_EQ(loaded.max_depth, 6);
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "integrator 'aov' is not driftlight's; only its max_depth");
}

// --- What grows ----------------------------------------------------------------------------------

TEST(Growth, OfTextIsBounded) {
  std::string body = R"(<default name="a0" value="xxxxxxxx"/>)";
  for (int i = 1; i < 40; ++i)
    body += fmt::format(R"(<default name="a{}" value="$a{}$a{}"/>)", i, i - 1, i - 1);
  expect_contains(error_of(complete(body)), "longer than 65536 characters");
}

TEST(Growth, OfIncludesIsBounded) {
  const SceneDirectory directory;
  for (int i = 0; i < 12; ++i) {
    const std::string include = fmt::format(R"(<include filename="part{}.xml"/>)", i + 1);
    directory.write(fmt::format("part{}.xml", i), test::scene_file(include + include));
  }
  directory.write("part12.xml", test::scene_file(""));
  try {
    directory.load(complete(R"(<include filename="part0.xml"/>)"));
    FAIL() << "included 8191 files";
  } catch (const SceneError& error) {
    expect_contains(error.what(), "more than 1000 files");
  }
}

TEST(Growth, OfNoticesIsBounded) {
  std::string body;
  for (int i = 0; i < 300; ++i) body += "<foreign/>";
  const SceneDirectory directory;
  EXPECT_EQ(directory.load(complete(body)).notices.size(), 201U);
}

}  // namespace
}  // namespace driftlight
