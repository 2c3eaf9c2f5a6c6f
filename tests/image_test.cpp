// SPDX-License-Identifier: Apache-2.0
/// Images: files keep what they promise, appear complete or not at all, and are compared right.
#include "driftlight/image.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <string>

#include "driftlight/error.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::SceneDirectory;

/// Numbers from tiny to huge, all different.
Image sample_image() {
  Image image(5, 3);
  for (std::size_t i = 0; i < image.rgb.size(); ++i)
    image.rgb[i] = std::ldexp(1.0F + static_cast<float>(i) / 64.0F, static_cast<int>(i) - 20);
  return image;
}

Image constant_image(int width, int height, float value) {
  Image image(width, height);
  image.rgb.assign(image.rgb.size(), value);
  return image;
}

std::set<std::string> names_in(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.insert(entry.path().filename().string());
  return names;
}

TEST(Image, FloatFormatsKeepEveryBit) {
  const SceneDirectory directory;
  const Image image = sample_image();
  for (const char* name : {"a.exr", "a.pfm"}) {
    const auto file = directory.path() / name;
    write_image(file, image);
    const Image read = read_image(file);
    EXPECT_EQ(read.width, image.width) << name;
    EXPECT_EQ(read.height, image.height) << name;
    EXPECT_EQ(read.rgb, image.rgb) << name;
  }
}

TEST(Image, RadianceFormatKeepsThePrecisionItHas) {
  const SceneDirectory directory;
  const auto file = directory.path() / "a.hdr";
  const Image image = sample_image();
  write_image(file, image);
  const Image read = read_image(file);
  ASSERT_EQ(read.rgb.size(), image.rgb.size());
  for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
    // One exponent for the three: eight bits of the largest.
    const float largest = image.rgb[i + 2];
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(read.rgb[i + c], image.rgb[i + c], largest / 128.0F) << i;
  }
}

TEST(Image, EightBitFormatsAreSrgb) {
  const SceneDirectory directory;
  const auto file = directory.path() / "a.PNG";
  Image image(4, 1);
  // 188 / 255 is the code of 0.5029; the other pixels are out of range.
  image.rgb = {0.0F,
               1.0F,
               0.5029F,
               -1.0F,
               7.0F,
               0.0F,
               std::numeric_limits<float>::quiet_NaN(),
               std::numeric_limits<float>::infinity(),
               0.0031F,
               0.2F,
               0.02F,
               0.9F};
  write_image(file, image);

  const auto input = OIIO::ImageInput::open(file.string());
  ASSERT_TRUE(input);
  EXPECT_EQ(input->spec().format, OIIO::TypeDesc::UINT8);
  std::vector<std::uint8_t> bytes(12);
  ASSERT_TRUE(input->read_image(0, 0, 0, 3, OIIO::TypeDesc::UINT8, bytes.data()));
  EXPECT_EQ(bytes[0], 0);
  EXPECT_EQ(bytes[1], 255);
  EXPECT_EQ(bytes[2], 188);
  EXPECT_EQ(bytes[3], 0);
  EXPECT_EQ(bytes[4], 255);
  EXPECT_EQ(bytes[6], 0);
  EXPECT_EQ(bytes[7], 255);
  EXPECT_EQ(bytes[8], 10);  // 12.92 * 0.0031 * 255 = 10.2

  const Image read = read_image(file);
  EXPECT_NEAR(read.rgb[2], 0.5029F, 1e-4F);
  EXPECT_NEAR(read.rgb[9], 0.2F, 0.002F);
  EXPECT_NEAR(read.rgb[10], 0.02F, 0.001F);
  EXPECT_NEAR(read.rgb[11], 0.9F, 0.005F);
}

TEST(Image, AGreyImageIsReadAsThreeEqualChannels) {
  const SceneDirectory directory;
  const auto file = directory.path() / "grey.exr";
  const std::vector<float> data{0.25F, 0.5F};
  const auto output = OIIO::ImageOutput::create(file.string());
  ASSERT_TRUE(output);
  ASSERT_TRUE(output->open(file.string(), OIIO::ImageSpec(2, 1, 1, OIIO::TypeDesc::FLOAT)));
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, data.data()));
  ASSERT_TRUE(output->close());
  EXPECT_EQ(read_image(file).rgb, (std::vector<float>{0.25F, 0.25F, 0.25F, 0.5F, 0.5F, 0.5F}));
}

TEST(Image, MetadataIsStoredAndNoDate) {
  const SceneDirectory directory;
  const auto file = directory.path() / "a.exr";
  write_image(file, sample_image(), {{"driftlight:seed", "12"}, {"Software", "driftlight"}});
  const auto input = OIIO::ImageInput::open(file.string());
  ASSERT_TRUE(input);
  EXPECT_EQ(input->spec().get_string_attribute("driftlight:seed"), "12");
  EXPECT_EQ(input->spec().get_string_attribute("Software"), "driftlight");
  // The present date would make every file another.
  EXPECT_EQ(input->spec().get_string_attribute("DateTime"), "");
}

TEST(Image, WritingLeavesNothingButTheTarget) {
  const SceneDirectory directory;
  directory.write("a.exr", "an old file");
  write_image(directory.path() / "a.exr", sample_image());
  write_image(directory.path() / "b.png", sample_image());
  write_image(directory.path() / "c.pfm", sample_image());
  EXPECT_EQ(names_in(directory.path()), (std::set<std::string>{"a.exr", "b.png", "c.pfm"}));
  EXPECT_EQ(read_image(directory.path() / "a.exr").rgb, sample_image().rgb);
}

TEST(Image, AFailedWriteLeavesNothing) {
  const SceneDirectory directory;
  std::filesystem::create_directory(directory.path() / "folder.exr");
  // The rename cannot replace a folder.
  EXPECT_THROW(write_image(directory.path() / "folder.exr", sample_image()), RuntimeError);
  EXPECT_THROW(write_image(directory.path() / "missing" / "a.exr", sample_image()), RuntimeError);
  EXPECT_THROW(write_image(directory.path() / "missing" / "a.pfm", sample_image()), RuntimeError);
  EXPECT_EQ(names_in(directory.path()), (std::set<std::string>{"folder.exr"}));
}

TEST(Image, UnknownFormatsAreInputErrors) {
  const SceneDirectory directory;
  for (const char* name : {"a.xyz", "a", "a.psd"}) {
    EXPECT_THROW(write_image(directory.path() / name, sample_image()), InputError) << name;
    EXPECT_THROW(check_writable(directory.path() / name), InputError) << name;
  }
  EXPECT_TRUE(names_in(directory.path()).empty());
}

TEST(Image, CheckWritableLooksAtTheFolder) {
  const SceneDirectory directory;
  std::filesystem::create_directory(directory.path() / "folder.exr");
  EXPECT_NO_THROW(check_writable(directory.path() / "a.exr"));
  EXPECT_NO_THROW(check_writable(directory.path() / "a.pfm"));
  EXPECT_NO_THROW(check_writable("a.exr"));
  EXPECT_THROW(check_writable(directory.path() / "missing" / "a.exr"), InputError);
  EXPECT_THROW(check_writable(directory.path() / "folder.exr"), InputError);
  EXPECT_EQ(names_in(directory.path()), (std::set<std::string>{"folder.exr"}));
}

TEST(Image, UnreadableFilesAreInputErrors) {
  const SceneDirectory directory;
  EXPECT_THROW(read_image(directory.path() / "missing.exr"), InputError);
  EXPECT_THROW(read_image(directory.path()), InputError);
  EXPECT_THROW(read_image(directory.write("text.exr", "not an image")), InputError);
  EXPECT_THROW(read_image(directory.write("text.png", "not an image")), InputError);
}

TEST(Difference, OfEqualImagesIsNone) {
  const Difference d = difference(sample_image(), sample_image());
  EXPECT_EQ(d.mse, 0.0);
  EXPECT_EQ(d.relmse, 0.0);
  EXPECT_EQ(d.relmse_trimmed, 0.0);
  EXPECT_EQ(d.mape, 0.0);
  EXPECT_EQ(d.mean, 1.0);
}

TEST(Difference, OfConstantImages) {
  const Difference d = difference(constant_image(8, 4, 3.0F), constant_image(8, 4, 2.0F));
  EXPECT_NEAR(d.mse, 1.0, 1e-12);
  EXPECT_NEAR(d.relmse, 1.0 / 4.01, 1e-12);
  EXPECT_NEAR(d.relmse_trimmed, 1.0 / 4.01, 1e-12);
  EXPECT_NEAR(d.mape, 1.0 / 2.01, 1e-12);
  EXPECT_NEAR(d.mean, 1.5, 1e-12);
}

TEST(Difference, IsRelativeToTheReference) {
  const Difference d = difference(constant_image(1, 1, 2.0F), constant_image(1, 1, 3.0F));
  EXPECT_DOUBLE_EQ(d.relmse, 1.0 / 9.01);
  EXPECT_DOUBLE_EQ(d.mape, 1.0 / 3.01);
  EXPECT_DOUBLE_EQ(d.mean, 2.0 / 3.0);
}

TEST(Difference, TrimsTheWorstThousandthOfThePixels) {
  // 2000 pixels of error 1 in one channel; two of them are fireflies.
  const Image reference = constant_image(50, 40, 0.0F);
  Image image = reference;
  for (std::size_t i = 0; i < image.rgb.size(); i += 3) image.rgb[i] = 1.0F;
  image.pixel(7, 3)[1] = 100.0F;
  image.pixel(49, 39)[2] = 50.0F;
  const Difference two = difference(image, reference);
  EXPECT_NEAR(two.relmse, (2000.0 + 10000.0 + 2500.0) / 0.01 / 6000.0, 1e-6);
  EXPECT_NEAR(two.relmse_trimmed, 100.0 / 3.0, 1e-9);
  // A third stays.
  image.pixel(0, 0)[1] = 2.0F;
  EXPECT_NEAR(difference(image, reference).relmse_trimmed, (1998.0 + 4.0) / 0.01 / 3.0 / 1998.0,
              1e-9);
}

TEST(Difference, ShowsWhatIsNotANumberButTrimsIt) {
  const Image reference = constant_image(50, 40, 1.0F);
  Image image = reference;
  image.pixel(1, 1)[0] = std::numeric_limits<float>::quiet_NaN();
  image.pixel(2, 2)[1] = std::numeric_limits<float>::infinity();
  const Difference d = difference(image, reference);
  EXPECT_FALSE(std::isfinite(d.mse));
  EXPECT_FALSE(std::isfinite(d.relmse));
  EXPECT_EQ(d.relmse_trimmed, 0.0);
}

TEST(Difference, NeedsEqualSizes) {
  EXPECT_THROW(difference(Image(2, 3), Image(3, 2)), InputError);
}

}  // namespace
}  // namespace driftlight
