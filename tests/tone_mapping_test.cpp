// SPDX-License-Identifier: Apache-2.0
/// Laws of tone mapping.
#include "driftlight/tone_mapping.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/scene_directory.h"

namespace driftlight {
namespace {

using Bytes = std::vector<std::uint8_t>;

Image gray(const std::vector<float>& values) {
  Image image(static_cast<int>(values.size()), 1);
  for (std::size_t i = 0; i < values.size(); ++i) std::fill_n(&image.rgb[3 * i], 3, values[i]);
  return image;
}

/// One value a pixel, of gray ones.
Bytes mapped(const std::vector<float>& values, const ToneMapping& how) {
  const Bytes all = tone_map(gray(values), how);
  Bytes result;
  for (std::size_t i = 0; i < all.size(); i += 3) {
    EXPECT_EQ(all[i], all[i + 1]);
    EXPECT_EQ(all[i], all[i + 2]);
    result.push_back(all[i]);
  }
  return result;
}

std::uint8_t code(double x) { return static_cast<std::uint8_t>(std::lround(255.0 * x)); }

// Law: an f-stop doubles the radiance.
TEST(ToneMapping, ExposureIsInStops) {
  ToneMapping brighter;
  brighter.exposure = 2;
  EXPECT_EQ(mapped({0.0F, 0.01F, 0.1F, 0.24F, 3.0F}, brighter),
            mapped({0.0F, 0.04F, 0.4F, 0.96F, 3.0F}, {}));
}

TEST(ToneMapping, GammaIsAPower) {
  ToneMapping power;
  power.gamma = 2.0;
  EXPECT_EQ(mapped({0.0F, 0.04F, 0.25F, 1.0F, 9.0F, -1.0F}, power),
            (Bytes{0, code(0.2), code(0.5), 255, 255, 0}));
  EXPECT_EQ(mapped({std::numeric_limits<float>::quiet_NaN()}, power), Bytes{0});
}

// Law: with linear values, (1) and (4) of the paper: the geometric mean is at the key, the largest
// luminance is white, and the colour is kept.
TEST(ToneMapping, ReinhardFollowsThePaper) {
  ToneMapping reinhard;
  reinhard.op = ToneMapping::Operator::Reinhard;
  reinhard.gamma = 1.0;
  const std::vector<float> values{0.5F, 2.0F, 8.0F};
  const auto expected = [&](double y, double white) {
    const double mean = std::cbrt((0.5 + 1e-3) * (2.0 + 1e-3) * (8.0 + 1e-3));
    const double l = 0.18 / mean * y;
    const double w = 0.18 / mean * white;
    return code(std::min(1.0, l * (1.0 + l / (w * w)) / (1.0 + l)));
  };
  EXPECT_EQ(mapped(values, reinhard), (Bytes{expected(0.5, 8), expected(2, 8), 255}));
  reinhard.burn = 0.5;  // white is a fourth of the largest
  EXPECT_EQ(mapped(values, reinhard), (Bytes{expected(0.5, 2), 255, 255}));

  reinhard.burn = 0;
  Image colored(2, 1);
  colored.rgb = {0.2F, 0.4F, 0.1F, 0.2F, 0.4F, 0.1F};
  const Bytes bytes = tone_map(colored, reinhard);
  EXPECT_NEAR(bytes[0] / 2, bytes[2], 1);
  EXPECT_EQ(tone_map(gray({0.0F, 0.0F}), reinhard), Bytes(6, 0));
}

TEST(ToneMapping, IsReadFromTheFilm) {
  const test::SceneDirectory directory;
  const auto tones = [&](const std::string& film) {
    return directory
        .load(test::scene_file(R"(<sensor type="perspective">)" + film + "</sensor>" +
                               test::kEmitter + test::kShape))
        .tone_mapping;
  };
  const ToneMapping linear = tones(R"(<film type="hdrfilm"/>)");
  EXPECT_EQ(linear.exposure, 0.0);
  const ToneMapping plain = tones(
      R"(<film type="ldrfilm"><float name="gamma" value="2.2"/><float name="exposure" value="-1"/>
         <boolean name="banner" value="false"/></film>)");
  EXPECT_EQ(plain.op, ToneMapping::Operator::Exposure);
  EXPECT_EQ(plain.gamma, 2.2);
  EXPECT_EQ(plain.exposure, -1.0);
  const ToneMapping photographic = tones(
      R"(<film type="ldrfilm"><string name="tonemapMethod" value="reinhard"/>
         <float name="key" value="0.3"/><float name="burn" value="0.1"/></film>)");
  EXPECT_EQ(photographic.op, ToneMapping::Operator::Reinhard);
  EXPECT_EQ(photographic.key, 0.3);
  EXPECT_EQ(photographic.burn, 0.1);
  EXPECT_FALSE(photographic.gamma.has_value());
}

}  // namespace
}  // namespace driftlight
