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
  for (const auto distribution : {Distribution::Beckmann, Distribution::Ggx}) {
    for (const double alpha : {0.02, 0.1, 0.4, 1.0}) result.push_back({distribution, alpha});
    result.push_back({distribution, 0.3, 0.1});
    result.push_back({distribution, 0.1, 0.7});
  }
  result.push_back({Distribution::Phong, 0.02});
  result.push_back({Distribution::Phong, 0.3, 0.1});
  result.push_back({Distribution::Phong, 0.2, 1.0});
  return result;
}

std::string name(const Microfacets& m) {
  const std::string names[] = {"beckmann ", "ggx ", "phong "};
  return names[static_cast<int>(m.distribution)] + std::to_string(m.alpha_u) + " " +
         std::to_string(m.alpha_v);
}

/// The tangent is x; the vector that tells it has another length and a part along the normal.
const SurfacePoint<double> kFlat{Vec3d::UnitZ(), Vec2d::Zero(), Vec3d(2, 0, 1)};

Vec3d direction(double cosine) {
  const double sine = std::sqrt(1.0 - cosine * cosine);
  return {0.8 * sine, 0.6 * sine, cosine};
}

double density(const Microfacets& m, const Vec3d& h) {
  const double cos2 = h.z() * h.z();
  return std::exp(m.log_d(cos2, m.steepness(kFlat, h, cos2)));
}

double shadowing(const Microfacets& m, const Vec3d& w) { return m.g1(m.grazing(kFlat, w, w.z())); }

/// Integral over the hemisphere of f(h), in (theta, phi) with theta = pi / 2 x^2.
double hemisphere(const std::function<double(const Vec3d&)>& f) {
  const auto integrand = [&](double x, double phi) {
    const double theta = 0.5 * kPi * x * x;
    const double sine = std::sin(theta);
    return kPi * x * sine * f({sine * std::cos(phi), sine * std::sin(phi), std::cos(theta)});
  };
  return integrate(integrand, 0.0, 1.0, 0.0, 2.0 * kPi, 1e-7, 9);
}

// Law: the projected area of the facets is that of the surface, integral D(h) cos(h) dh = 1.
TEST(Microfacets, ProjectedAreaIsOne) {
  for (const Microfacets& m : all())
    EXPECT_NEAR(hemisphere([&](const Vec3d& h) { return density(m, h) * h.z(); }), 1.0, 1e-5)
        << name(m);
}

// Law: the visible facets have the projected area of the surface seen from wi,
// integral G1(wi) D(h) max(0, wi.h) dh = cos_i: exact for GGX, to the error of the published fit
// (half a per cent) for Beckmann; Phong has Beckmann's.
TEST(Microfacets, VisibleAreaIsTheProjectedOne) {
  for (const Microfacets& m : all()) {
    if (m.distribution == Distribution::Phong) continue;
    for (const double cosine : {0.9, 0.5, 0.1}) {
      const Vec3d wi = direction(cosine);
      const double area = hemisphere([&](const Vec3d& h) {
        return shadowing(m, wi) * density(m, h) * std::max(0.0, wi.dot(h));
      });
      const double tolerance = m.distribution == Distribution::Ggx ? 1e-4 : 5e-3;
      EXPECT_NEAR(area / cosine, 1.0, tolerance) << name(m) << " cos " << cosine;
    }
  }
}

// Law: facet normals are drawn with the density that pdf says.
TEST(Microfacets, SampleFollowsPdf) {
  Rng rng(71, Stream::Test, 0);
  const double significance = sidak(0.01, 15 * 4);
  for (const Microfacets& m : all()) {
    for (const double cosine : {1.0, 0.7, 0.2, 0.03}) {
      const Vec3d wi = direction(cosine);
      // Seventeen of the rings fill the upper half.
      const SphereGrid grid(Vec3d::UnitZ(), 24, 12, std::log(2.0) / std::log(24.0 / 17.0));
      const auto draw = [&] { return m.sample(kFlat, wi, rng.uniform(), rng.uniform()); };
      const auto pdf = [&](const Vec3d& h) { return m.pdf(kFlat, wi, h); };
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
    EXPECT_NEAR(shadowing(m, Vec3d::UnitZ()), 1.0, 1e-12);
    double last = 1.0;
    for (double cosine = 1.0; cosine > 1e-3; cosine -= 1e-3) {
      const double g = shadowing(m, direction(cosine));
      // The fit overshoots 1 by no more than its error.
      EXPECT_LE(g, last + 4e-3) << name(m);
      EXPECT_GT(g, 0.0) << name(m);
      last = g;
    }
  }
  const Microfacets m{Distribution::Beckmann, 0.5};
  const double edge = 1.0 / (1.6 * 1.6);
  EXPECT_NEAR(m.g1(edge * (1.0 - 1e-9)), m.g1(edge * (1.0 + 1e-9)), 5e-3);
}

// Law: slope_variance is the variance of the slopes along each axis for Beckmann, and r / U'(r)
// along it of U = -log D cos^4 for GGX.
TEST(Microfacets, SlopeVariance) {
  Rng rng(72, Stream::Test, 0);
  const Microfacets beckmann{Distribution::Beckmann, 0.3, 0.1};
  Moments along;
  Moments across;
  for (int i = 0; i < 20000; ++i) {
    const Vec3d h = beckmann.sample<double>(kFlat, Vec3d::UnitZ(), rng.uniform(), rng.uniform());
    along.add(std::pow(h.x() / h.z(), 2));
    across.add(std::pow(h.y() / h.z(), 2));
  }
  EXPECT_NEAR(along.mean(), beckmann.slope_variance(0.3, 0.0), 4.5 * along.error());
  EXPECT_NEAR(across.mean(), beckmann.slope_variance(0.1, 0.0), 4.5 * across.error());

  const Microfacets ggx{Distribution::Ggx, 0.3, 0.8};
  const auto potential = [&](double u, double v) {
    const double cos2 = 1.0 / (1.0 + u * u + v * v);
    return -std::log(density(ggx, Vec3d(u, v, 1.0) * std::sqrt(cos2))) - 2.0 * std::log(cos2);
  };
  for (const double r : {0.05, 0.3, 2.0}) {
    const double t = r * r / (0.3 * 0.3) + 0.25 / (0.8 * 0.8);
    const double slope = (potential(r + 1e-5, 0.5) - potential(r - 1e-5, 0.5)) / 2e-5;
    EXPECT_NEAR(ggx.slope_variance(0.3, t), r / slope, 1e-6 * r / slope);
  }
}

}  // namespace
}  // namespace driftlight::test
