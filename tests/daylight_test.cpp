// SPDX-License-Identifier: Apache-2.0
/// The sun's place, and the sky and the sun as environment maps.
#include "scene_file/daylight.h"

#include <gtest/gtest.h>

#include <cmath>

#include "driftlight/emitter.h"
#include "driftlight/scene_file.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

constexpr double kDegree = kPi / 180.0;

// At noon the sun is in the south, at 90 degrees - latitude + declination; the declination is 23.44
// degrees at the solstice of June. The equation of time is -1.8 minutes then.
TEST(Daylight, TheSunOfASolsticeAtNoon) {
  PlaceAndTime greenwich{51.4769, 0.0, 0.0, 2010, 6, 21, 12.0, 1.8, 0.0};
  const SunPosition noon = sun_position(greenwich);
  EXPECT_NEAR(noon.zenith, (51.4769 - 23.44) * kDegree, 0.02 * kDegree);
  EXPECT_NEAR(noon.azimuth, kPi, 0.2 * kDegree);
  // Before noon it is in the east, as high as after noon in the west.
  greenwich.hour = 8.0;
  const SunPosition morning = sun_position(greenwich);
  greenwich.hour = 16.0;
  const SunPosition evening = sun_position(greenwich);
  EXPECT_NEAR(morning.zenith, evening.zenith, 0.1 * kDegree);
  EXPECT_NEAR(morning.azimuth + evening.azimuth, 2.0 * kPi, 0.3 * kDegree);
  EXPECT_LT(morning.azimuth, kPi);
  // The same moment of another clock.
  greenwich.hour = 21.0;
  greenwich.timezone = 5.0;
  EXPECT_NEAR(sun_position(greenwich).zenith, evening.zenith, 1e-9);
}

TEST(Daylight, DirectionsAreThoseOfEnvironmentMaps) {
  const SunPosition sun{0.7, 4.0};
  const SunPosition back = position_of_sun(3.0 * sun_direction(sun));
  EXPECT_NEAR(back.zenith, sun.zenith, 1e-12);
  EXPECT_NEAR(back.azimuth, sun.azimuth, 1e-12);
  const EnvironmentMap map(daylight_map(3.0, sun, {.width = 512, .sky_scale = 0.0}),
                           Eigen::Matrix3d::Identity(), 1.0);
  const double at_sun = luminance(map.eval<double>(sun_direction(sun)));
  EXPECT_GT(at_sun, 0.0);
  EXPECT_EQ(luminance(map.eval<double>(sun_direction({sun.zenith + 0.1, sun.azimuth}))), 0.0);
}

// Law: whatever the map's resolution and the sun's size, the sun brings L times its solid angle.
TEST(Daylight, TheSunKeepsItsPower) {
  const SunPosition sun{0.8, 2.0};
  const double expected =
      luminance(Daylight(4.0, sun).sun()) * 2.0 * kPi * (1.0 - std::cos(kSunRadius));
  for (const int width : {64, 512, 2048}) {
    for (const double scale : {0.0001, 1.0, 5.0}) {
      DaylightMap how;
      how.width = width;
      how.sky_scale = 0.0;
      how.sun_radius = scale * kSunRadius;
      const EnvironmentMap map(daylight_map(4.0, sun, how), Eigen::Matrix3d::Identity(), 1.0);
      EXPECT_NEAR(map.total_luminance(), expected, (width == 64 ? 0.02 : 2e-3) * expected)
          << width << " " << scale;
    }
  }
  // In the order of the direct sun at sea level, 100 klx.
  const double lux = expected * 683.0 * 106.857;
  EXPECT_GT(lux, 5e4);
  EXPECT_LT(lux, 1.3e5);
}

// The paper's own numbers: at the zenith the sky has the zenith's luminance; a clear sky is blue
// away from the sun, brighter near it, and haze is whiter.
TEST(Daylight, TheSkyOfThePaper) {
  const SunPosition sun{0.9, 1.0};
  const double t = 3.0;
  const double chi = (4.0 / 9.0 - t / 120.0) * (kPi - 2.0 * sun.zenith);
  const double zenith = (4.0453 * t - 4.9710) * std::tan(chi) - 0.2155 * t + 2.4192;
  const Daylight clear(t, sun);
  const Rgbd above = clear.sky(0.0, sun.zenith);
  EXPECT_NEAR(luminance(above), 1000.0 * zenith / (683.0 * 106.857), 2e-3 * luminance(above));
  EXPECT_GT(above.z(), 1.3 * above.x());
  EXPECT_GT(luminance(clear.sky(0.9, 0.05)), 2.0 * luminance(above));
  const Rgbd haze = Daylight(8.0, sun).sky(0.0, sun.zenith);
  EXPECT_LT(haze.z() / haze.x(), above.z() / above.x());
  // A low sun is red.
  const Rgbd low = Daylight(t, {1.5, 1.0}).sun();
  EXPECT_GT(low.x(), 2.0 * low.z());
}

const std::string kSunAbove = R"(<vector name="sunDirection" x="0" y="1" z="0"/>)";

LoadedScene load_daylight(const std::string& emitter) {
  const test::SceneDirectory directory;
  return directory.load(test::with_sensor(test::kShape + emitter));
}

TEST(EmittersXml, ReadsDaylight) {
  const LoadedScene both = load_daylight(
      R"(<emitter type="sunsky">)" + kSunAbove +
      R"(<float name="turbidity" value="4"/><integer name="resolution" value="256"/></emitter>)");
  ASSERT_EQ(both.notices.size(), 1U);
  EXPECT_NE(both.notices[0].find("Preetham"), std::string::npos);
  const auto& map = std::get<EnvironmentMap>(both.scene.emitters()[0]);
  EXPECT_EQ(map.bitmap().width, 256);
  const Vec3d up(0, 1, 0);
  EXPECT_GT(luminance(map.eval<double>(up)), 100.0);
  EXPECT_EQ(luminance(map.eval<double>(Vec3d(0.6, -0.8, 0))), 0.0);

  // Law: the scale is that of each part which has none of its own.
  const auto scaled = [](const std::string& content) {
    const LoadedScene loaded =
        load_daylight(R"(<emitter type="sunsky">)" + kSunAbove +
                      R"(<integer name="resolution" value="64"/>)" + content + "</emitter>");
    return std::get<EnvironmentMap>(loaded.scene.emitters()[0]).bitmap().texels;
  };
  const auto twice = scaled(R"(<float name="scale" value="2"/>)");
  const auto each = scaled(R"(<float name="sunScale" value="2"/><float name="skyScale" value="2"/>
                              <float name="scale" value="7"/>)");
  for (std::size_t i = 0; i < twice.size(); ++i) test::expect_near(twice[i], each[i], 0.0);

  const auto of_sky = load_daylight(R"(<emitter type="sky">)" + kSunAbove +
                                    R"(<float name="scale" value="2"/></emitter>)");
  const auto& sky = std::get<EnvironmentMap>(of_sky.scene.emitters()[0]);
  const Vec3d aside = Vec3d(0.6, 0.8, 0).normalized();
  const Rgbd expected = 2.0 * Daylight(3.0, {}).sky(std::acos(0.8), std::acos(0.8));
  EXPECT_NEAR(luminance(sky.eval<double>(aside)), luminance(expected), 0.01 * luminance(expected));
}

TEST(EmittersXml, ASunWithoutExtentIsDirectional) {
  const auto loaded = load_daylight(R"(<emitter type="sun">)" + kSunAbove +
                                    R"(<float name="sunRadiusScale" value="0"/></emitter>)");
  ASSERT_EQ(loaded.scene.emitters().size(), 1U);
  const auto& sun = std::get<DirectionalEmitter>(loaded.scene.emitters()[0]);
  test::expect_near(sun.direction, Vec3d(0, -1, 0));
}

}  // namespace
}  // namespace driftlight
