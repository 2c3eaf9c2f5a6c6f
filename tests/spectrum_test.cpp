// SPDX-License-Identifier: Apache-2.0
#include "../src/scene_file/spectrum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "../src/scene_file/cie_1931.h"

namespace driftlight {
namespace {

void expect_near(const Rgbd& actual, const Rgbd& expected, double tolerance) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(actual[c], expected[c], tolerance) << "component " << c;
}

TEST(Cie1931, HasItsPublishedValues) {
  const auto at = [](int nm) { return &kCie1931[3 * static_cast<std::size_t>(nm - kCieFirst)]; };
  EXPECT_NEAR(at(555)[1], 1.0, 1e-6);
  EXPECT_NEAR(at(600)[0], 1.0622, 1e-6);
  EXPECT_NEAR(at(445)[2], 1.78260, 1e-4);
  // An equal-energy spectrum is neutral: the three functions have the same integral.
  Vec3d sum = Vec3d::Zero();
  for (int nm = kCieFirst; nm < kCieFirst + kCieSamples; ++nm) sum += Vec3d(at(nm));
  EXPECT_NEAR(sum.x() / sum.y(), 1.0, 5e-4);
  EXPECT_NEAR(sum.z() / sum.y(), 1.0, 5e-4);
}

TEST(Spectrum, EqualEnergyIsMitsubasPink) {
  expect_near(spectrum_to_rgb({{300, 1}, {900, 1}}), {1.2049, 0.9483, 0.9093}, 1e-4);
}

TEST(Spectrum, DaylightOnWhiteIsWhite) {
  expect_near(reflectance_to_rgb({{300, 1}, {900, 1}}), {1, 1, 1}, 1e-3);
}

TEST(Spectrum, BlackBodiesPeakAsWienSays) {
  const Spectrum spectrum = blackbody(5000.0);
  const auto brightest = std::max_element(
      spectrum.begin(), spectrum.end(),
      [](const SpectrumSample& a, const SpectrumSample& b) { return a.value < b.value; });
  EXPECT_NEAR(brightest->wavelength, 2.897771955e6 / 5000.0, 0.5);
  EXPECT_NEAR(brightest->value, 4.0957e-6 * std::pow(5000.0, 5) * 1e-9, 20.0);
}

TEST(Spectrum, EqualEnergyHasUnitLuminance) {
  EXPECT_NEAR(luminance<double>(spectrum_to_rgb({{300, 1}, {900, 1}})), 1.0, 1e-4);
}

TEST(Spectrum, NarrowPeakShowsTheMatchingFunctionsThere) {
  const double y_integral = 106.857;
  const Rgbd rgb = spectrum_to_rgb({{599, 0}, {600, 1}, {601, 0}});
  const double x = 1.0622, y = 0.631, z = 0.0008;
  const Rgbd expected{3.240479 * x - 1.537150 * y - 0.498535 * z,
                      -0.969256 * x + 1.875991 * y + 0.041556 * z, 0.0};  // blue is clamped
  expect_near(rgb * y_integral, expected, 2e-3);
}

TEST(Spectrum, IsLinear) {
  const Rgbd a = spectrum_to_rgb({{400, 0}, {550, 0.8}, {700, 0}});
  const Rgbd b = spectrum_to_rgb({{400, 0}, {550, 2.4}, {700, 0}});
  expect_near(3.0 * a, b, 1e-12);
}

TEST(Spectrum, ExtraSamplesOnTheLineChangeNothing) {
  const Rgbd a = spectrum_to_rgb({{410.3, 0.2}, {690.7, 0.9}});
  const double middle = 0.2 + 0.7 * (533.25 - 410.3) / (690.7 - 410.3);
  expect_near(spectrum_to_rgb({{410.3, 0.2}, {533.25, middle}, {690.7, 0.9}}), a, 1e-12);
}

TEST(Spectrum, InvisibleLightIsBlack) {
  expect_near(spectrum_to_rgb({{100, 1}, {350, 1}}), Rgbd::Zero(), 0.0);
  expect_near(spectrum_to_rgb({{840, 1}, {2000, 1}}), Rgbd::Zero(), 0.0);
}

TEST(Spectrum, RampsToZeroOverTheMeanSpacing) {
  const Spectrum ramped = ramp_to_zero({{400, 1}, {500, 2}, {700, 3}});
  ASSERT_EQ(ramped.size(), 5U);
  EXPECT_EQ(ramped.front().wavelength, 250);
  EXPECT_EQ(ramped.front().value, 0);
  EXPECT_EQ(ramped.back().wavelength, 850);
  EXPECT_EQ(ramped.back().value, 0);
}

TEST(Spectrum, DoesNotRampFromZero) {
  EXPECT_EQ(ramp_to_zero({{400, 0}, {500, 2}, {700, 0}}).size(), 3U);
}

// By hand: a line from 1 to 3 and one from 3 to 0, each from the wrong end.
TEST(Spectrum, BackwardsIsSwappedBetweenSamples) {
  const Spectrum line = interpolated_backwards({{400, 1}, {500, 3}, {700, 0}});
  ASSERT_EQ(line.size(), 4U);
  const std::array<SpectrumSample, 4> expected{{{400, 3}, {500, 1}, {500, 0}, {700, 3}}};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(line[i].wavelength, expected[i].wavelength);
    EXPECT_EQ(line[i].value, expected[i].value);
  }
}

// The light of the Cornell box, by the midpoint rule on a grid of 0.05 nm apart from this code. In
// line with its samples it would be (20.78, 10.85, 2.771).
TEST(Spectrum, LightOfTheCornellBoxBackwards) {
  const Spectrum light = ramp_to_zero({{400, 0}, {500, 8}, {600, 15.6}, {700, 18.4}});
  expect_near(spectrum_to_rgb(interpolated_backwards(light)), Rgbd(18.38605, 10.98827, 2.753473),
              1e-4);
  expect_near(spectrum_to_rgb(light), Rgbd(20.77976, 10.84758, 2.770555), 1e-4);
}

TEST(Srgb, HasItsPublishedValues) {
  EXPECT_DOUBLE_EQ(srgb_to_linear(0.0), 0.0);
  EXPECT_DOUBLE_EQ(srgb_to_linear(1.0), 1.0);
  EXPECT_NEAR(srgb_to_linear(0.5), 0.2140411, 1e-6);
  EXPECT_NEAR(srgb_to_linear(0.04), 0.04 / 12.92, 1e-12);
}

}  // namespace
}  // namespace driftlight
