// SPDX-License-Identifier: Apache-2.0
/// Laws of Fresnel reflectance.
#include "driftlight/fresnel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

namespace driftlight::test {
namespace {

// Law: ((eta - 1) / (eta + 1))^2 at normal incidence, from either side.
TEST(FresnelDielectric, NormalIncidence) {
  for (const double eta : {1.1, 1.5, 2.4}) {
    const double expected = std::pow((eta - 1.0) / (eta + 1.0), 2);
    EXPECT_NEAR(fresnel_dielectric(1.0, eta), expected, 1e-15);
    EXPECT_NEAR(fresnel_dielectric(1.0, 1.0 / eta), expected, 1e-15);
  }
  EXPECT_NEAR(fresnel_dielectric(1.0, 1.5), 0.04, 1e-15);
}

// Law: at Brewster's angle, tan = eta, the parallel part is 0 and R = (cos 2 theta)^2 / 2.
TEST(FresnelDielectric, BrewstersAngle) {
  for (const double eta : {1.0 / 1.5, 1.33, 1.5, 2.0}) {
    const double theta = std::atan(eta);
    EXPECT_NEAR(fresnel_dielectric(std::cos(theta), eta), 0.5 * std::pow(std::cos(2.0 * theta), 2),
                1e-14);
  }
}

// Law: total internal reflection beyond the critical angle, and 1 in the limit of grazing.
TEST(FresnelDielectric, TotalReflection) {
  const double eta = 1.0 / 1.5;
  const double critical = std::sqrt(1.0 - eta * eta);
  EXPECT_EQ(fresnel_dielectric(0.999 * critical, eta), 1.0);
  EXPECT_EQ(fresnel_dielectric(0.0, eta), 1.0);
  EXPECT_LT(fresnel_dielectric(1.001 * critical, eta), 1.0);
  EXPECT_NEAR(fresnel_dielectric(critical * (1.0 + 1e-12), eta), 1.0, 1e-4);
  EXPECT_NEAR(fresnel_dielectric(1e-9, 1.5), 1.0, 1e-7);
}

// Law: both sides of an interface reflect the same at angles related by Snell's law: what is not
// reflected passes, either way.
TEST(FresnelDielectric, SymmetricUnderSnellsLaw) {
  const double eta = 1.5;
  for (double cosine = 0.01; cosine <= 1.0; cosine += 0.01) {
    const double cos_t = std::sqrt(1.0 - (1.0 - cosine * cosine) / (eta * eta));
    EXPECT_NEAR(fresnel_dielectric(cosine, eta), fresnel_dielectric(cos_t, 1.0 / eta), 1e-12);
  }
}

// Law: reflectances are fractions.
TEST(Fresnel, IsAFraction) {
  for (double cosine = 0.0; cosine <= 1.0; cosine += 0.01) {
    for (const double eta : {0.0, 0.2, 0.7, 1.0, 1.5, 3.0}) {
      for (const double k : {0.1, 1.0, 4.0}) {
        const double r = fresnel_conductor(cosine, eta, k);
        EXPECT_GE(r, 0.0);
        EXPECT_LE(r, 1.0 + 1e-12);
      }
      if (eta == 0.0) continue;
      const double r = fresnel_dielectric(cosine, eta);
      EXPECT_GE(r, 0.0);
      EXPECT_LE(r, 1.0);
    }
  }
}

// Law: without absorption a conductor is a dielectric, beyond the critical angle too.
TEST(FresnelConductor, WithoutAbsorptionEqualsDielectric) {
  for (const double eta : {0.6, 1.3, 1.5, 2.5})
    for (double cosine = 0.005; cosine <= 1.0; cosine += 0.01)
      EXPECT_NEAR(fresnel_conductor(cosine, eta, 0.0), fresnel_dielectric(cosine, eta), 1e-12);
}

// Law: at normal incidence ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2).
TEST(FresnelConductor, NormalIncidence) {
  for (const double eta : {0.0, 0.143, 1.0, 2.7})
    for (const double k : {0.3, 2.0, 4.0}) {
      const double expected =
          ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k);
      EXPECT_NEAR(fresnel_conductor(1.0, eta, k), expected, 1e-14);
    }
}

/// |r|^2 of the complex Fresnel coefficients, averaged over polarisations.
double complex_reflectance(double cosine, double eta, double k) {
  using Complex = std::complex<double>;
  const Complex n(eta, k);
  const Complex cos_t = std::sqrt(1.0 - (1.0 - cosine * cosine) / (n * n));
  const Complex parallel = (n * cosine - cos_t) / (n * cosine + cos_t);
  const Complex perpendicular = (cosine - n * cos_t) / (cosine + n * cos_t);
  return 0.5 * (std::norm(parallel) + std::norm(perpendicular));
}

// Law: the real formula is |r|^2 of the complex coefficients, small eta included.
TEST(FresnelConductor, EqualsTheComplexFormula) {
  for (const double eta : {1e-6, 0.143, 0.9, 1.4, 3.0})
    for (const double k : {0.2, 1.0, 3.9})
      for (double cosine = 0.01; cosine <= 1.0; cosine += 0.01)
        EXPECT_NEAR(fresnel_conductor(cosine, eta, k), complex_reflectance(cosine, eta, k), 1e-10);
}

// Law: a metal with eta = 0 is a perfect mirror, R = 1 with derivative 0.
TEST(FresnelConductor, PerfectMirror) {
  using J = ceres::Jet<double, 1>;
  for (const double k : {0.5, 1.0, 4.0}) {
    for (double cosine = 0.1; cosine <= 1.0; cosine += 0.1) {
      const J r = fresnel_conductor(J(cosine, 0), 0.0, k);
      EXPECT_NEAR(r.a, 1.0, 1e-15);
      EXPECT_NEAR(r.v[0], 0.0, 1e-12);
    }
  }
}

}  // namespace
}  // namespace driftlight::test
