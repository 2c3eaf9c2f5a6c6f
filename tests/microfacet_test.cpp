// SPDX-License-Identifier: Apache-2.0
/// Laws of microfacet distributions.
#include "driftlight/microfacet.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "driftlight/random.h"
#include "support/chi_square.h"
#include "support/t_test.h"

namespace driftlight::test {
namespace {

std::vector<Microfacets> all() {
  std::vector<Microfacets> result;
  for (const auto distribution : {Distribution::Beckmann, Distribution::Ggx})
    for (const double alpha : {0.02, 0.1, 0.4, 1.0}) result.push_back({distribution, alpha});
  return result;
}

std::string name(const Microfacets& m) {
  return (m.distribution == Distribution::Ggx ? "ggx " : "beckmann ") + std::to_string(m.alpha);
}

Vec3d direction(double cosine) { return {std::sqrt(1.0 - cosine * cosine), 0.0, cosine}; }

double density(const Microfacets& m, double cosine) { return std::exp(m.log_d(cosine * cosine)); }

/// Integral over the hemisphere of f(h), in (theta, phi) with theta = pi / 2 x^2.
double hemisphere(const std::function<double(const Vec3d&)>& f) {
  const auto integrand = [&](double x, double phi) {
    const double theta = 0.5 * kPi * x * x;
    const double sine = std::sin(theta);
    return kPi * x * sine * f({sine * std::cos(phi), sine * std::sin(phi), std::cos(theta)});
  };
  return 2.0 * integrate(integrand, 0.0, 1.0, 0.0, kPi, 1e-7, 9);
}

// Law: the projected area of the facets is that of the surface, integral D(h) cos(h) dh = 1.
TEST(Microfacets, ProjectedAreaIsOne) {
  for (const Microfacets& m : all())
    EXPECT_NEAR(hemisphere([&](const Vec3d& h) { return density(m, h.z()) * h.z(); }), 1.0, 1e-5)
        << name(m);
}

// Law: the visible facets have the projected area of the surface seen from wi,
// integral G1(wi) D(h) max(0, wi.h) dh = cos_i: exact for GGX, to the error of the published fit
// (half a per cent) for Beckmann.
TEST(Microfacets, VisibleAreaIsTheProjectedOne) {
  for (const Microfacets& m : all()) {
    for (const double cosine : {0.9, 0.5, 0.1}) {
      const Vec3d wi = direction(cosine);
      const double area = hemisphere([&](const Vec3d& h) {
        return m.g1(cosine) * density(m, h.z()) * std::max(0.0, wi.dot(h));
      });
      const double tolerance = m.distribution == Distribution::Ggx ? 1e-4 : 5e-3;
      EXPECT_NEAR(area / cosine, 1.0, tolerance) << name(m) << " cos " << cosine;
    }
  }
}

// Law: facet normals are drawn with the density that pdf says.
TEST(Microfacets, SampleFollowsPdf) {
  Rng rng(71, Stream::Test, 0);
  const double significance = sidak(0.01, 8 * 4);
  for (const Microfacets& m : all()) {
    for (const double cosine : {1.0, 0.7, 0.2, 0.03}) {
      const Vec3d wi = direction(cosine);
      // Seventeen of the rings fill the upper half.
      const SphereGrid grid(Vec3d::UnitZ(), 24, 12, std::log(2.0) / std::log(24.0 / 17.0));
      const auto draw = [&] { return m.sample(wi, rng.uniform(), rng.uniform()); };
      const auto pdf = [&](const Vec3d& h) { return m.pdf(cosine, h.z(), wi.dot(h)); };
      const ChiSquareResult result = chi_square_directions(grid, 8000, draw, pdf);
      EXPECT_GT(result.p_value, significance) << name(m) << " cos " << cosine << " chi^2 "
                                              << result.statistic << " of " << result.degrees;
    }
  }
}

// Law: G1 is a fraction, 1 for perpendicular directions, and falls toward grazing; Beckmann's fit
// is continuous where it reaches 1.
TEST(Microfacets, ShadowingIsAFallingFraction) {
  for (const Microfacets& m : all()) {
    EXPECT_NEAR(m.g1(1.0), 1.0, 1e-12);
    double last = 1.0;
    for (double cosine = 1.0; cosine > 1e-3; cosine -= 1e-3) {
      const double g = m.g1(cosine);
      // The fit overshoots 1 by no more than its error.
      EXPECT_LE(g, last + 4e-3) << name(m);
      EXPECT_GT(g, 0.0) << name(m);
      last = g;
    }
  }
  const Microfacets m{Distribution::Beckmann, 0.5};
  const double edge = 1.0 / std::sqrt(1.0 + 1.0 / (m.alpha * m.alpha * 1.6 * 1.6));
  EXPECT_NEAR(m.g1(edge * (1.0 - 1e-9)), m.g1(edge * (1.0 + 1e-9)), 5e-3);
}

// Law: slope_variance is the variance of the slopes for Beckmann, and r / U'(r) per axis of
// U = -log D cos^4 for GGX.
TEST(Microfacets, SlopeVariance) {
  Rng rng(72, Stream::Test, 0);
  const Microfacets beckmann{Distribution::Beckmann, 0.3};
  Moments squares;
  for (int i = 0; i < 20000; ++i) {
    const Vec3d h = beckmann.sample<double>(Vec3d::UnitZ(), rng.uniform(), rng.uniform());
    squares.add(std::pow(h.x() / h.z(), 2));
  }
  EXPECT_NEAR(squares.mean(), beckmann.slope_variance(0.0), 4.5 * squares.error());

  const Microfacets ggx{Distribution::Ggx, 0.3};
  const auto potential = [&](double r) {
    const double cos2 = 1.0 / (1.0 + r * r);
    return -ggx.log_d(cos2) - 2.0 * std::log(cos2);
  };
  for (const double r : {0.05, 0.3, 2.0}) {
    const double slope = (potential(r + 1e-5) - potential(r - 1e-5)) / 2e-5;
    EXPECT_NEAR(ggx.slope_variance(r * r), r / slope, 1e-6 * r / slope);
  }
}

}  // namespace
}  // namespace driftlight::test
