// SPDX-License-Identifier: Apache-2.0
/// Textures of scene files, in both dialects.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>

#include "driftlight/scene_file.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::expect_contains;
using test::expect_near;
using test::SceneDirectory;

/// A file of 2 by 1 texels, 128 and 255 grey.
void write_two_greys(const std::filesystem::path& file) {
  const auto output = OIIO::ImageOutput::create(file.string());
  ASSERT_TRUE(output);
  ASSERT_TRUE(output->open(file.string(), OIIO::ImageSpec(2, 1, 3, OIIO::TypeDesc::UINT8)));
  const std::vector<unsigned char> values{128, 128, 128, 255, 255, 255};
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::UINT8, values.data()));
  ASSERT_TRUE(output->close());
}

LoadedScene load(const std::string& texture, const std::string& version) {
  const SceneDirectory directory;
  write_two_greys(directory.path() / "two.png");
  return directory.load("<scene version=\"" + version +
                        R"("><shape type="rectangle"><bsdf type="diffuse">)" + texture +
                        "</bsdf></shape>" + test::kSensor + test::kEmitter + "</scene>");
}

Texture texture_of(const std::string& texture, const std::string& version = "0.6.0") {
  return std::get<Diffuse>(load(texture, version).scene.bsdfs()[0]).reflectance;
}

std::string texture(const std::string& type, const std::string& content) {
  return "<texture name=\"reflectance\" type=\"" + type + "\">" + content + "</texture>";
}

std::string bitmap(const std::string& content) {
  return texture("bitmap", R"(<string name="filename" value="two.png"/>)" + content);
}

std::string error_of(const std::string& element, const std::string& version = "0.6.0") {
  return test::scene_error([&] { load(element, version); });
}

TEST(BitmapXml, ReadsWrapModes) {
  const Texture both = texture_of(bitmap(R"(<string name="wrapMode" value="mirror"/>)"));
  EXPECT_EQ(both.wrap_u, Wrap::Mirror);
  EXPECT_EQ(both.wrap_v, Wrap::Mirror);
  const Texture each = texture_of(
      bitmap(R"(<string name="wrapModeU" value="clamp"/><string name="wrapModeV" value="zero"/>)"));
  EXPECT_EQ(each.wrap_u, Wrap::Clamp);
  EXPECT_EQ(each.wrap_v, Wrap::Zero);
  const Texture newer = texture_of(bitmap(R"(<string name="wrap_mode" value="clamp"/>)"), "3.0.0");
  EXPECT_EQ(newer.wrap_v, Wrap::Clamp);
  expect_contains(error_of(bitmap(R"(<string name="wrapMode" value="fold"/>)")), "mirror, zero");
}

TEST(BitmapXml, ReadsFilters) {
  EXPECT_FALSE(texture_of(bitmap(R"(<string name="filterType" value="nearest"/>)")).interpolates);
  EXPECT_EQ(load(bitmap(""), "0.6.0").notices.size(), 1U);  // ewa
  EXPECT_TRUE(load(bitmap(""), "3.0.0").notices.empty());   // bilinear
  EXPECT_TRUE(texture_of(bitmap("")).interpolates);
}

TEST(BitmapXml, RefusesSingleChannels) {
  expect_contains(error_of(bitmap(R"(<string name="channel" value="r"/>)")),
                  "'channel' is not supported in texture 'bitmap'");
}

TEST(BitmapXml, LeavesRawFilesAsTheyAre) {
  const Texture raw = texture_of(bitmap(R"(<boolean name="raw" value="true"/>)"), "3.0.0");
  EXPECT_NEAR(raw.bitmap->at(0, 0).x(), 128.0 / 255.0, 1e-6);
  EXPECT_LT(texture_of(bitmap(""), "3.0.0").bitmap->at(0, 0).x(), 0.22F);
}

TEST(BitmapXml, NoticesNormalsThatAreDecodedAsSrgb) {
  const SceneDirectory directory;
  write_two_greys(directory.path() / "two.png");
  const auto notices = [&](const std::string& type, const std::string& content) {
    return directory
        .load(test::lit(R"(<shape type="rectangle"><bsdf type=")" + type +
                        R"("><texture type="bitmap"><string name="filename" value="two.png"/>
                           <string name="filterType" value="bilinear"/>)" +
                        content + R"(</texture><bsdf type="diffuse"/></bsdf></shape>)"))
        .notices;
  };
  for (const std::string type : {"normalmap", "bumpmap"}) {
    ASSERT_EQ(notices(type, "").size(), 1U);
    expect_contains(notices(type, "")[0], "'gamma' as 1");
    EXPECT_TRUE(notices(type, R"(<float name="gamma" value="1"/>)").empty());
    EXPECT_TRUE(notices(type, R"(<float name="gamma" value="-1"/>)").empty());
  }
}

TEST(BitmapXml, MapsCoordinates) {
  const Texture newer =
      texture_of(bitmap(R"(<transform name="to_uv"><scale x="2" y="3"/><rotate z="1" angle="90"/>
                <translate x="0.5"/></transform>)"),
                 "3.0.0");
  expect_near(newer.uv_to_texture, (Eigen::Matrix2d() << 0, -3, 2, 0).finished());
  expect_near(newer.uv_offset, Vec2d(0.5, 0));
}

TEST(PatternXml, ReadsCheckerboards) {
  const Texture board = texture_of(texture(
      "checkerboard", R"(<rgb name="color0" value="0.9"/><float name="uscale" value="4"/>)"));
  ASSERT_TRUE(board.pattern.has_value());
  EXPECT_EQ(board.pattern->layout, TwoColors::Layout::Checkerboard);
  expect_near(board.pattern->color0, Rgbd(0.9, 0.9, 0.9));
  expect_near(board.pattern->color1, Rgbd(0.2, 0.2, 0.2));
  EXPECT_EQ(board.uv_to_texture(0, 0), 4.0);
  const Texture newer = texture_of(
      texture("checkerboard", R"(<transform name="to_uv"><scale value="8"/></transform>)"),
      "3.0.0");
  EXPECT_EQ(newer.uv_to_texture(1, 1), 8.0);
}

TEST(PatternXml, ReadsGrids) {
  const Texture grid =
      texture_of(texture("gridtexture", R"(<float name="lineWidth" value="0.05"/>)"));
  ASSERT_TRUE(grid.pattern.has_value());
  EXPECT_EQ(grid.pattern->layout, TwoColors::Layout::Grid);
  EXPECT_EQ(grid.pattern->line_width, 0.05);
  expect_near(grid.pattern->color1, Rgbd(0.4, 0.4, 0.4));
}

TEST(ScaleXml, ScalesTexturesAndColors) {
  const std::string nested = R"(<texture type="checkerboard"/>)";
  const Texture by_number =
      texture_of(texture("scale", nested + R"(<float name="scale" value="0.5"/>)"));
  expect_near(by_number.eval<double>(Vec2d(0.2, 0.2)), Rgbd(0.2, 0.2, 0.2));
  const Texture by_color =
      texture_of(texture("scale", nested + R"(<rgb name="scale" value="1, 0.5, 0"/>)"));
  expect_near(by_color.eval<double>(Vec2d(0.2, 0.2)), Rgbd(0.4, 0.2, 0));
  const Texture color = texture_of(
      texture("scale", R"(<rgb name="value" value="0.4"/><float name="scale" value="0.5"/>)"));
  expect_near(color.color, Rgbd(0.2, 0.2, 0.2));
  expect_contains(error_of(texture("scale", "")), "needs a texture");
  expect_contains(error_of(texture("scale", nested + nested)), "second texture");
}

TEST(TexturesXml, EnergyOfPatternsIsConserved) {
  const LoadedScene loaded =
      load(texture("checkerboard", R"(<rgb name="color1" value="2, 1, 1"/>)"), "0.6.0");
  const Texture& board = std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance;
  EXPECT_NEAR(board.maximum(), 0.99, 1e-12);
  EXPECT_EQ(loaded.notices.size(), 1U);
}

// --- Vertex colours ------------------------------------------------------------------------------

/// Two triangles; the colours of the corners of the rectangle are red, green, blue and grey.
std::string colored_ply(const std::string& type, const std::string& one, const std::string& half) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex 4\n";
  for (const char* name : {"x", "y", "z"}) text += std::string("property float ") + name + "\n";
  for (const char* name : {"red", "green", "blue"}) text += "property " + type + " " + name + "\n";
  text += "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
  text += "0 0 0 " + one + " 0 0\n2 0 0 0 " + one + " 0\n2 1 0 0 0 " + one + "\n0 1 0 " + half +
          " " + half + " " + half + "\n3 0 1 2\n3 0 2 3\n";
  return text;
}

/// Shapes of colored.ply.
LoadedScene load_colored(const std::string& ply, const std::string& shapes,
                         const std::string& version = "0.6.0") {
  const SceneDirectory directory;
  directory.write("colored.ply", ply);
  return directory.load("<scene version=\"" + version + "\">" + shapes + test::kSensor +
                        test::kEmitter + "</scene>");
}

std::string colored_shape(const std::string& content) {
  return R"(<shape type="ply"><string name="filename" value="colored.ply"/>)" + content +
         "</shape>";
}

const std::string kVertexColors = R"(<texture name="reflectance" type="vertexcolors"/>)";

/// The texture's colour at the point (x, y) of the first shape.
Rgbd color_at(const LoadedScene& loaded, const Texture& texture, double x, double y) {
  const Geometry& geometry = loaded.scene.shapes()[0].geometry;
  const std::uint32_t triangle = y < 0.5 * x ? 0 : 1;
  const Ray<double> ray{{x, y, 1}, {0, 0, -1}};
  return texture.eval<double>(interact(geometry, triangle, ray, true).uv);
}

// Law: colours are linear over each triangle, whatever their type and the dialect.
TEST(VertexColors, AreLinearOverTriangles) {
  const double half = std::pow((0.5 + 0.055) / 1.055, 2.4);
  const auto expect_colors = [](const LoadedScene& loaded, double grey) {
    const Texture& texture = std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance;
    for (const double u : {0.001, 0.3, 0.7, 0.999}) {
      for (const double v : {0.0005, 0.2, 0.8, 0.9995}) {
        const Rgbd expected =
            v < u ? Rgbd(1.0 - u, u - v, v) : Rgbd(Rgbd(1.0 - v, 0.0, u) + (v - u) * grey);
        expect_near(color_at(loaded, texture, 2.0 * u, v), expected);
      }
    }
  };
  const std::string shape = colored_shape("<bsdf type=\"diffuse\">" + kVertexColors + "</bsdf>");
  expect_colors(load_colored(colored_ply("float", "1", "0.5"), shape), half);
  expect_colors(load_colored(colored_ply("uchar", "255", "128"), shape),
                std::pow((128.0 / 255.0 + 0.055) / 1.055, 2.4));
  const std::string linear = colored_shape(
      R"(<boolean name="srgb" value="false"/><bsdf type="diffuse">)" + kVertexColors + "</bsdf>");
  expect_colors(load_colored(colored_ply("float", "1", "0.5"), linear), 0.5);
  const std::string newer = colored_shape(
      R"(<bsdf type="diffuse"><texture name="reflectance" type="mesh_attribute">
         <string name="name" value="vertex_color"/></texture></bsdf>)");
  expect_colors(load_colored(colored_ply("float", "1", "0.5"), newer, "3.0.0"), 0.5);
}

// Law: shapes that share a bsdf keep their own colours, also in bsdfs that are nested.
TEST(VertexColors, BelongToTheirShapes) {
  const std::string shared =
      R"(<bsdf type="mask" id="b"><float name="opacity" value="0.5"/>
         <bsdf type="twosided"><bsdf type="diffuse">)" +
      kVertexColors + "</bsdf></bsdf></bsdf>";
  const LoadedScene loaded = load_colored(
      colored_ply("float", "1", "0.5"),
      shared + colored_shape(R"(<ref id="b"/>)") +
          colored_shape(
              R"(<ref id="b"/><transform name="toWorld"><translate z="1"/></transform>)"));
  const auto bitmap_of = [&](std::size_t shape) {
    const Material& material = loaded.scene.materials()[loaded.scene.shapes()[shape].material];
    const auto& mask = std::get<Mask>(loaded.scene.bsdfs()[material.front]);
    return std::get<Diffuse>(mask.nested->bsdf).reflectance.bitmap;
  };
  EXPECT_NE(bitmap_of(0), bitmap_of(1));
  EXPECT_EQ(bitmap_of(0)->width, 4);
  EXPECT_EQ(bitmap_of(1)->height, 2);
}

TEST(VertexColors, AreRefusedWhereTheyCannotBe) {
  const std::string plain = colored_ply("float", "1", "0.5");
  const auto error = [&](const std::string& shapes, const std::string& version = "0.6.0") {
    return test::scene_error([&] { load_colored(plain, shapes, version); });
  };
  const std::string diffuse = "<bsdf type=\"diffuse\">" + kVertexColors + "</bsdf>";
  expect_contains(error("<shape type=\"sphere\">" + diffuse + "</shape>"), "no vertex colours");
  expect_contains(error(colored_shape(R"(<bsdf type="bumpmap"><texture type="checkerboard"/>)" +
                                      diffuse + "</bsdf>")),
                  "bump map");
  expect_contains(
      error(colored_shape(R"(<bsdf type="mask"><texture name="opacity" type="checkerboard"/>)" +
                          diffuse + "</bsdf>")),
      "another texture");
  expect_contains(
      error(colored_shape(R"(<bsdf type="blendbsdf"><texture name="weight" type="vertexcolors"/>)" +
                          diffuse + diffuse + "</bsdf>")),
      "one number");
  expect_contains(
      error(colored_shape(
          R"(<emitter type="area"><texture name="radiance" type="vertexcolors"/></emitter>)")),
      "radiance");
  expect_contains(
      error(colored_shape(
          diffuse +
          R"(<emitter type="area"><texture name="radiance" type="checkerboard"/></emitter>)")),
      "textured radiance");
  expect_contains(
      error(colored_shape(
                R"(<bsdf type="diffuse"><texture name="reflectance" type="mesh_attribute">
                   <string name="name" value="face_color"/></texture></bsdf>)"),
            "3.0.0"),
      "vertex_color");
}

}  // namespace
}  // namespace driftlight
