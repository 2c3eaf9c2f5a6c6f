// SPDX-License-Identifier: Apache-2.0
/// Textures of scene files, in both dialects.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

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

TEST(BitmapXml, LeavesRawFilesAsTheyAre) {
  const Texture raw = texture_of(bitmap(R"(<boolean name="raw" value="true"/>)"), "3.0.0");
  EXPECT_NEAR(raw.bitmap->at(0, 0).x(), 128.0 / 255.0, 1e-6);
  EXPECT_LT(texture_of(bitmap(""), "3.0.0").bitmap->at(0, 0).x(), 0.22F);
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

}  // namespace
}  // namespace driftlight
