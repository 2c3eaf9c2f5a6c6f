// SPDX-License-Identifier: Apache-2.0
#include "driftlight/scene_file.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/places.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::complete;
using test::expect_contains;
using test::expect_near;
using test::kEmitter;
using test::kShape;
using test::lit;
using test::scene_file;
using test::SceneDirectory;

std::string sensor(const std::string& properties, int width = 200, int height = 100,
                   const std::string& type = "perspective") {
  return R"(<sensor type=")" + type + R"(">)" + properties + R"(<film type="hdrfilm">)" +
         R"(<integer name="width" value=")" + std::to_string(width) + R"("/>)" +
         R"(<integer name="height" value=")" + std::to_string(height) + R"("/>)" +
         R"(<rfilter type="box"/></film></sensor>)";
}

Camera load_camera(const std::string& properties, int width = 200, int height = 100,
                   const std::string& type = "perspective") {
  const SceneDirectory directory;
  const std::string text = scene_file(sensor(properties, width, height, type) + kEmitter + kShape);
  return directory.load(text).scene.camera();
}

// --- The file ------------------------------------------------------------------------------------

TEST(SceneFile, ReadsThePartsOfAScene) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(complete(""));
  EXPECT_EQ(loaded.scene.shapes().size(), 1U);
  EXPECT_EQ(loaded.scene.emitters().size(), 1U);
  EXPECT_EQ(loaded.scene.camera().film_width, 200);
  EXPECT_EQ(loaded.scene.camera().film_height, 100);
  EXPECT_TRUE(loaded.notices.empty());
}

TEST(SceneFile, SubstitutesDefaults) {
  const SceneDirectory directory;
  const LoadedScene loaded =
      directory.load(lit(R"(<default name="r" value="2.5"/><default name="rough" value="ignored"/>
             <shape type="sphere"><float name="radius" value="$r"/></shape>)"));
  EXPECT_EQ(std::get<Sphere>(loaded.scene.shapes()[0].geometry).radius, 2.5);
}

TEST(SceneFile, UserDefinitionsWinOverDefaults) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(R"(<default name="r" value="2.5"/>
             <shape type="sphere"><float name="radius" value="1$r"/></shape>)"),
                                            {{{"r", "7"}}});
  EXPECT_EQ(std::get<Sphere>(loaded.scene.shapes()[0].geometry).radius, 17);
}

TEST(SceneFile, TheLongestNameIsSubstituted) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(R"(<default name="rad" value="1"/>
             <shape type="sphere"><float name="radius" value="$radius2"/></shape>)"),
                                            {{{"radius", "3"}}});
  EXPECT_EQ(std::get<Sphere>(loaded.scene.shapes()[0].geometry).radius, 32);
}

TEST(SceneFile, ValuesAreNotSubstitutedAgain) {
  const SceneDirectory directory;
  const auto load = [&] {
    directory.load(lit(R"(<shape type="sphere"><float name="radius" value="$a"/></shape>)"),
                   {{{"a", "$a$a"}}});
  };
  EXPECT_THROW(load(), SceneError);  // "$a$a" is no number, and grows no further
}

TEST(SceneFile, IncludesOtherFilesInPlace) {
  const SceneDirectory directory;
  directory.write("materials.xml", scene_file(R"(<bsdf type="diffuse" id="m">
      <rgb name="reflectance" value="0.1"/></bsdf><default name="r" value="3"/>)"));
  const LoadedScene loaded = directory.load(lit(R"(<include filename="materials.xml"/>
             <shape type="sphere"><ref id="m"/><float name="radius" value="$r"/></shape>)"));
  EXPECT_EQ(std::get<Sphere>(loaded.scene.shapes()[0].geometry).radius, 3);
  expect_near(std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance.color,
              Rgbd::Constant(0.1).eval());
}

TEST(SceneFile, KeepsTheDepthOfIntegrators) {
  const SceneDirectory directory;
  const auto depth = [&](const std::string& value) {
    return directory
        .load(complete(R"(<integrator type="path"><integer name="maxDepth" value=")" + value +
                       R"("/><integer name="rrDepth" value="5"/></integrator>)"))
        .max_depth;
  };
  EXPECT_EQ(depth("8"), 8);
  EXPECT_EQ(depth("-1"), std::nullopt);
}

TEST(SceneFile, SaysWhichIntegratorIsNotOurs) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(complete(
      R"(<integrator type="bdpt"><integer name="maxDepth" value="3"/>
         <boolean name="strictNormals" value="true"/></integrator>)"));
  EXPECT_EQ(loaded.max_depth, 3);
  ASSERT_EQ(loaded.notices.size(), 1U);
  EXPECT_NE(loaded.notices[0].find("scene.xml:2:1: integrator 'bdpt' is not driftlight's"),
            std::string::npos);
}

// Law: emitted and direct light take at most two edges.
TEST(SceneFile, TheDirectIntegratorTakesTwoEdges) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(complete(R"(<integrator type="direct"/>)"));
  EXPECT_EQ(loaded.max_depth, 2);
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "2 edges");
}

TEST(SceneFile, KeepsTheDepthOfForeignBlocks) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(complete(
      R"(<dpt><string name="integrator" value="mcmc"/>
         <integer name="maxdepth" value="8"/></dpt>)"));
  EXPECT_EQ(loaded.max_depth, 8);
  ASSERT_EQ(loaded.notices.size(), 1U);
  EXPECT_NE(loaded.notices[0].find("<dpt>"), std::string::npos);
}

// --- The film ------------------------------------------------------------------------------------

/// A scene whose sensor has this content.
LoadedScene load_with(const std::string& content) {
  return SceneDirectory().load(
      scene_file("<sensor type=\"perspective\">" + content + "</sensor>" + kEmitter + kShape));
}

TEST(FilmXml, ASensorWithoutAFilmHasTheDefaultOne) {
  const LoadedScene loaded = load_with("");
  const Camera& camera = loaded.scene.camera();
  EXPECT_EQ(camera.film_width, 768);
  EXPECT_EQ(camera.film_height, 576);
  EXPECT_EQ(camera.filter.kind, ReconstructionFilter::Kind::Gaussian);
  EXPECT_EQ(camera.filter.radius, 2.0);
  EXPECT_TRUE(loaded.notices.empty());
}

TEST(FilmXml, SkipsAnnotations) {
  const LoadedScene loaded = load_with(
      R"(<film type="ldrfilm"><string name="label[10, 10]" value="$integrator['type'], $scene['x']"/>
         <string name="metadata['Author']" value="nobody"/></film>)");
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "label[10, 10], metadata['Author']");
  EXPECT_THROW(
      load_with(R"(<film type="hdrfilm"><string name="label[1,1]" value="$scene"/></film>)"),
      SceneError);
}

TEST(FilmXml, NoticesFormatsOfPixels) {
  for (const std::string format : {"luminance", "rgba", "spectrum"}) {
    const LoadedScene loaded = load_with(
        R"(<film type="hdrfilm"><string name="pixelFormat" value=")" + format + R"("/></film>)");
    ASSERT_EQ(loaded.notices.size(), 1U);
    expect_contains(loaded.notices[0], "pixelFormat '" + format + "'");
  }
  EXPECT_TRUE(load_with(R"(<film type="hdrfilm"><string name="pixelFormat" value="RGB"/></film>)")
                  .notices.empty());
}

// --- The sensor ----------------------------------------------------------------------------------

// Law: without an up the sensor is turned as Mitsuba's is, which differs by version.
TEST(SensorXml, LooksAtWithoutUp) {
  const auto up = [](const std::string& attribute, const std::string& version) {
    std::string file = scene_file(
        sensor(R"(<transform name="toWorld"><lookat origin="1, 2, 3" target="1.6, 2, 3.8")" +
               attribute + "/></transform>") +
        kEmitter + kShape);
    file.replace(file.find("0.6.0"), 5, version);
    return SceneDirectory().load(file).scene.camera().up;
  };
  for (const std::string attribute : {"", R"( up="")", R"( up="0, 0, 0")"}) {
    expect_near(up(attribute, "0.6.0"), Vec3d(0, -1, 0));
    expect_near(up(attribute, "3.0.0"), Vec3d(0.8, 0, -0.6));
  }
}

TEST(SensorXml, LooksAlongZWithXOnTheLeft) {
  const Camera camera = load_camera(R"(<float name="fov" value="60"/>)");
  expect_near(camera.right, Vec3d(-1, 0, 0));
  expect_near(camera.up, Vec3d(0, 1, 0));
  expect_near(camera.forward, Vec3d(0, 0, 1));
  EXPECT_EQ(camera.near_clip, 1e-2);
  EXPECT_EQ(camera.far_clip, 1e4);
}

// Law: each pixel of a crop window looks where that pixel of the whole film does.
TEST(SensorXml, CropsTheFilm) {
  const auto load = [](const std::string& crop) {
    const SceneDirectory directory;
    const std::string sensor =
        R"(<sensor type="perspective"><float name="fov" value="70"/><film type="hdrfilm">
           <integer name="width" value="40"/><integer name="height" value="30"/>)" +
        crop + R"(<rfilter type="box"/></film></sensor>)";
    return directory.load(scene_file(sensor + kEmitter + kShape)).scene.camera();
  };
  const Camera whole = load("");
  const Camera part = load(
      R"(<integer name="cropOffsetX" value="12"/><integer name="cropOffsetY" value="4"/>
         <integer name="cropWidth" value="20"/><integer name="cropHeight" value="6"/>)");
  EXPECT_EQ(part.film_width, 20);
  EXPECT_EQ(part.film_height, 6);
  for (const Vec2d& pixel : {Vec2d(0, 0), Vec2d(3.5, 1.25), Vec2d(19.9, 5.9)}) {
    const Vec3d v = part.direction({pixel.x() / 20, pixel.y() / 6});
    expect_near(v, whole.direction({(12 + pixel.x()) / 40, (4 + pixel.y()) / 30}));
    EXPECT_LT((part.film_position(v, part.origin) - Vec2d(pixel.x() / 20, pixel.y() / 6)).norm(),
              1e-12);
    EXPECT_TRUE(part.sees(v, part.origin));
  }
  EXPECT_FALSE(part.sees(whole.direction({11.9 / 40, 0.2}), part.origin));
  EXPECT_NEAR(part.area(), whole.area() * 120 / 1200, 1e-12);
}

TEST(SensorXml, ReadsFilters) {
  using Kind = ReconstructionFilter::Kind;
  const auto load = [](const std::string& filter) {
    const SceneDirectory directory;
    const std::string sensor =
        R"(<sensor type="perspective"><film type="hdrfilm">)" + filter + "</film></sensor>";
    const LoadedScene loaded = directory.load(scene_file(sensor + kEmitter + kShape));
    EXPECT_TRUE(loaded.notices.empty());
    return loaded.scene.camera().filter;
  };
  const auto expect = [&](const std::string& text, Kind kind, double radius) {
    const ReconstructionFilter filter = load(text);
    EXPECT_EQ(filter.kind, kind) << text;
    EXPECT_EQ(filter.radius, radius) << text;
    return filter;
  };
  EXPECT_TRUE(load(R"(<rfilter type="box"/>)").is_pixel());
  EXPECT_EQ(expect("", Kind::Gaussian, 2.0).sigma, 0.5);
  expect(R"(<rfilter type="box"><float name="radius" value="2"/></rfilter>)", Kind::Box, 2.0);
  expect(R"(<rfilter type="tent"/>)", Kind::Tent, 1.0);
  expect(R"(<rfilter type="gaussian"><float name="stddev" value="0.25"/></rfilter>)",
         Kind::Gaussian, 1.0);
  EXPECT_EQ(expect(R"(<rfilter type="mitchell"><float name="B" value="0.3"/></rfilter>)",
                   Kind::Cubic, 2.0)
                .b,
            0.3);
  EXPECT_EQ(expect(R"(<rfilter type="catmullrom"/>)", Kind::Cubic, 2.0).c, 0.5);
  expect(R"(<rfilter type="lanczos"><integer name="lobes" value="2"/></rfilter>)", Kind::Lanczos,
         2.0);
}

// Law: with an offset each film point shows what is beside it without, also where it is cropped.
TEST(SensorXml, ShiftsTheFilm) {
  const std::string fov = R"(<float name="fov" value="70"/>)";
  const Camera plain = load_camera(fov);
  const Camera shifted = load_camera(fov + R"(<float name="principalPointOffsetX" value="0.25"/>
                                             <float name="principalPointOffsetY" value="-0.1"/>)");
  for (const Vec2d& film : {Vec2d(0.5, 0.5), Vec2d(0.1, 0.8)}) {
    const Vec3d v = shifted.direction(film);
    expect_near(v, plain.direction(Vec2d(film + Vec2d(0.25, -0.1))));
    EXPECT_LT((shifted.film_position(v, shifted.origin) - film).norm(), 1e-12);
  }
}

// Law: an orthographic sensor sees [-1, 1] across, scaled by its transform, and as high as its
// aspect wants.
TEST(SensorXml, ReadsOrthographicSensors) {
  const auto load = [](const std::string& to_world, int width, int height) {
    const SceneDirectory directory;
    const std::string sensor = R"(<sensor type="orthographic"><transform name="toWorld">)" +
                               to_world +
                               R"(</transform><film type="hdrfilm"><integer name="width" value=")" +
                               std::to_string(width) + R"("/><integer name="height" value=")" +
                               std::to_string(height) + R"("/></film></sensor>)";
    return directory.load(scene_file(sensor + kEmitter + kShape)).scene.camera();
  };
  const Camera camera = load(R"(<scale x="10" y="5"/><lookat origin="1, 2, 3" target="1, 2, -5"
                                up="0, 1, 0"/>)",
                             200, 100);
  EXPECT_TRUE(camera.is_orthographic());
  for (const Vec2d& film : {Vec2d(0.5, 0.5), Vec2d(0.0, 0.0), Vec2d(1.0, 0.25)}) {
    const Ray<double> ray = camera.ray<double>(camera.direction(film), camera.origin);
    expect_near(ray.direction, Vec3d(0, 0, -1));
    expect_near(ray.origin, Vec3d(1 + 10 * (2 * film.x() - 1), 2 + 2.5 * (1 - 2 * film.y()), 3));
  }
  EXPECT_NEAR(camera.area() * camera.scale * camera.scale, 20.0 * 5.0, 1e-9);
}

// Law: all rays of a film point of a thinlens meet where it is in focus, which the pinhole sees
// there.
TEST(SensorXml, ReadsThinLenses) {
  const std::string fov = R"(<float name="fov" value="70"/>)";
  const Camera pinhole = load_camera(fov);
  const Camera camera = load_camera(fov + R"(<float name="apertureRadius" value="0.3"/>
                                             <float name="focusDistance" value="7"/>)",
                                    200, 100, "thinlens");
  EXPECT_EQ(camera.lens_radius, 0.3);
  EXPECT_EQ(camera.focus_depth, 7);
  for (const Vec2d& film : {Vec2d(0.5, 0.5), Vec2d(0.1, 0.8)}) {
    const Vec3d v = pinhole.direction(film);
    const Vec3d focus = pinhole.origin + 7.0 / pinhole.cosine(v) * v;
    for (const Vec2d& u : {Vec2d(0.2, 0.7), Vec2d(0.99, 0.1)}) {
      const Vec3d lens = camera.lens_point(u);
      EXPECT_NEAR((lens - camera.origin).norm(), 0.3 * std::sqrt(u.x()), 1e-12);
      expect_near(camera.direction(film, lens), (focus - lens).normalized());
    }
  }
  // As far as one sees, if the file does not say.
  const Camera far =
      load_camera(R"(<float name="apertureRadius" value="0.3"/>)", 200, 100, "thinlens");
  EXPECT_EQ(far.focus_depth, far.far_clip);
}

TEST(SensorXml, LooksAtItsTarget) {
  const Camera camera = load_camera(
      R"(<float name="fov" value="60"/><float name="nearClip" value="2"/>
         <float name="farClip" value="50"/><float name="focusDistance" value="7"/>
         <transform name="toWorld">
           <lookAt origin="1, 2, 3" target="1, 2, -5" up="0, 3, 1"/></transform>)");
  expect_near(camera.origin, Vec3d(1, 2, 3));
  expect_near(camera.forward, Vec3d(0, 0, -1));
  expect_near(camera.up, Vec3d(0, 1, 0));
  expect_near(camera.right, Vec3d(1, 0, 0));
  EXPECT_EQ(camera.near_clip, 2);
  EXPECT_EQ(camera.far_clip, 50);
}

TEST(SensorXml, MeasuresTheFieldOfViewAlongItsAxis) {
  const auto camera = [](const std::string& axis, int width, int height) {
    return load_camera(
        R"(<float name="fov" value="60"/><string name="fovAxis" value=")" + axis + R"("/>)", width,
        height);
  };
  const double half = std::tan(kPi / 6.0);
  EXPECT_NEAR(camera("x", 200, 100).half_width, half, 1e-12);
  EXPECT_NEAR(camera("x", 200, 100).half_height, half / 2, 1e-12);
  EXPECT_NEAR(camera("y", 200, 100).half_height, half, 1e-12);
  EXPECT_NEAR(camera("smaller", 200, 100).half_height, half, 1e-12);
  EXPECT_NEAR(camera("smaller", 100, 200).half_width, half, 1e-12);
  EXPECT_NEAR(camera("larger", 200, 100).half_width, half, 1e-12);
  EXPECT_NEAR(camera("larger", 100, 200).half_height, half, 1e-12);
  const Camera diagonal = camera("diagonal", 200, 100);
  EXPECT_NEAR(std::hypot(diagonal.half_width, diagonal.half_height), half, 1e-12);
}

TEST(SensorXml, KnowsFocalLengths) {
  const auto diagonal = [](const std::string& properties) {
    const Camera camera = load_camera(properties);
    return std::hypot(camera.half_width, camera.half_height);
  };
  const double film = std::hypot(36.0, 24.0);
  EXPECT_NEAR(diagonal(""), film / 100.0, 1e-12);
  EXPECT_NEAR(diagonal(R"(<string name="focalLength" value="25mm"/>)"), film / 50.0, 1e-12);
}

// --- Scenes of others ----------------------------------------------------------------------------

class SharedScene : public ::testing::TestWithParam<const char*> {};

TEST_P(SharedScene, LoadsUnchanged) {
  const auto file = test::shared_folder() / "scenes" / GetParam();
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not on this machine";
  const LoadedScene loaded = load_scene(file);
  EXPECT_GE(loaded.scene.shapes().size(), 5U);
  EXPECT_EQ(loaded.scene.emitters().size(), 1U);
  EXPECT_TRUE(loaded.max_depth == 8 || loaded.max_depth == 10);
}

INSTANTIATE_TEST_SUITE_P(All, SharedScene,
                         ::testing::Values("cbox/scene.xml", "cbox_glossy/scene.xml",
                                           "torus/scene.xml", "torus/lmc.xml"));

}  // namespace
}  // namespace driftlight
