// SPDX-License-Identifier: Apache-2.0
/// Laws of the BSDFs: samples follow their pdf, no energy is gained, and light may be turned round.
#include "driftlight/bsdf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "driftlight/random.h"
#include "driftlight/warp.h"
#include "support/chi_square.h"
#include "support/t_test.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

struct Named {
  std::string name;
  Bsdf bsdf;
};

const Texture kWhite(Rgbd::Ones());

Texture bitmap_texture(double low, double high) {
  Texture texture;
  texture.bitmap = pattern_bitmap(8, 8, low, high);
  texture.uv_to_texture = Vec2d(2, 3).asDiagonal();
  return texture;
}

std::shared_ptr<const BsdfBox> boxed(Bsdf bsdf) {
  return std::make_shared<const BsdfBox>(BsdfBox{std::move(bsdf)});
}

/// White BSDFs that scatter into a density, smooth to rough.
std::vector<Named> scattering_bsdfs() {
  std::vector<Named> result;
  result.push_back({"diffuse", Diffuse{kWhite}});
  for (const auto distribution : {Distribution::Beckmann, Distribution::Ggx}) {
    const std::string kind = distribution == Distribution::Ggx ? "ggx" : "beckmann";
    for (const double alpha : {0.05, 0.3, 0.8}) {
      const std::string label = kind + " " + std::to_string(alpha);
      const Microfacets microfacets{distribution, alpha};
      result.push_back({"rough conductor " + label, RoughConductor{microfacets}});
      result.push_back(
          {"rough dielectric " + label, RoughDielectric{microfacets, 1.5, kWhite, kWhite}});
    }
  }
  result.push_back({"rough dielectric thin", RoughDielectric{{Distribution::Ggx, 0.2}, 1.1}});
  const Texture half(Rgbd::Constant(0.5));
  result.push_back({"phong 5", Phong{half, half, 5}});
  result.push_back({"phong 400", Phong{Texture(Rgbd::Constant(0.2)), half, 400}});
  result.push_back(
      {"phong textured", Phong{bitmap_texture(0.1, 0.4), bitmap_texture(0.0, 0.6), 40}});
  const Texture low(Rgbd::Constant(0.2));
  result.push_back({"ward", Ward{Ward::Variant::Ward, 0.3, 0.3, half, low}});
  result.push_back({"ward-duer", Ward{Ward::Variant::Duer, 0.3, 0.3, half, low}});
  result.push_back({"balanced ward 0.1", Ward{Ward::Variant::Balanced, 0.1, 0.1,
                                              bitmap_texture(0.1, 0.4), bitmap_texture(0.1, 0.5)}});
  for (const bool nonlinear : {false, true})
    result.push_back(
        {"rough plastic", RoughPlastic({Distribution::Ggx, 0.3}, 1.5, kWhite, kWhite, nonlinear)});
  result.push_back({"rough plastic 0.05", RoughPlastic({Distribution::Beckmann, 0.05}, 1.5,
                                                       bitmap_texture(0.2, 0.8), kWhite, true)});
  const Texture weight = bitmap_texture(0.1, 0.9);
  const auto metal = boxed(RoughConductor{{Distribution::Beckmann, 0.2}});
  result.push_back({"blend of diffuse and metal", Blend{weight, boxed(Diffuse{kWhite}), metal}});
  result.push_back(
      {"blend of rough glass, diffuse and metal",
       Blend{half, boxed(RoughDielectric{{Distribution::Ggx, 0.3}, 1.5, kWhite, kWhite}),
             boxed(Blend{weight, boxed(Diffuse{kWhite}), metal})}});
  for (const auto distribution : {Distribution::Beckmann, Distribution::Ggx}) {
    const Microfacets brushed{distribution, 0.4, 0.1};
    result.push_back({"brushed conductor", RoughConductor{brushed}});
    result.push_back(
        {"brushed dielectric", RoughDielectric{{distribution, 0.15, 0.5}, 1.5, kWhite, kWhite}});
  }
  result.push_back({"brushed phong conductor", RoughConductor{{Distribution::Phong, 0.4, 0.1}}});
  result.push_back({"brushed ward", Ward{Ward::Variant::Balanced, 0.1, 0.4, half, low}});
  return result;
}

/// White BSDFs with delta lobes and, the first ones, a density beside them. Their `sample` loses
/// nothing.
std::vector<Named> mixed_bsdfs() {
  const Texture half(Rgbd::Constant(0.5));
  const Texture holes = bitmap_texture(0.2, 0.7);
  std::vector<Named> result;
  result.push_back({"plastic", Plastic(1.5, kWhite, kWhite, true)});
  result.push_back({"plastic 1.2", Plastic(1.2, half, kWhite, false)});
  result.push_back({"masked diffuse", Mask{holes, boxed(Diffuse{kWhite})}});
  result.push_back({"masked plastic", Mask{half, boxed(Plastic(1.5, kWhite, kWhite, false))}});
  result.push_back({"masked mask", Mask{half, boxed(Mask{holes, boxed(Diffuse{kWhite})})}});
  result.push_back({"blend of plastic and mirror",
                    Blend{bitmap_texture(0.1, 0.9), boxed(Plastic(1.5, kWhite, kWhite, true)),
                          boxed(Conductor{})}});
  result.push_back({"thin dielectric", ThinDielectric{1.5, kWhite, kWhite}});
  result.push_back({"masked thin", Mask{half, boxed(ThinDielectric{1.5, kWhite, kWhite})}});
  const Texture weight = bitmap_texture(0.1, 0.9);
  const auto glass = boxed(Dielectric{1.5, kWhite, kWhite});
  result.push_back({"blend of glass", Blend{half, glass, glass}});
  result.push_back(
      {"blend of pane and null", Blend{weight, boxed(ThinDielectric{1.5, kWhite, kWhite}),
                                       boxed(Mask{Texture(Rgbd::Zero()), nullptr})}});
  result.push_back({"masked mirror", Mask{holes, boxed(Conductor{})}});
  result.push_back({"null", Mask{Texture(Rgbd::Zero()), nullptr}});
  return result;
}

/// A surface point with a tilted normal, and directions from perpendicular to grazing.
const SurfacePoint<double> kPoint{Vec3d(0.3, -0.5, 0.8).normalized(), Vec2d(0.37, 0.81),
                                  Vec3d(1.2, 0.5, -0.1)};

std::vector<Vec3d> view_directions(bool both_sides) {
  std::vector<Vec3d> result;
  for (const double cosine : {1.0, 0.8, 0.4, 0.1, 0.02}) {
    const double sine = std::sqrt(1.0 - cosine * cosine);
    const double phi = 1.0 + 3.0 * cosine;
    const Vec3d local(sine * std::cos(phi), sine * std::sin(phi), cosine);
    result.push_back(to_world(local, kPoint.n));
    if (both_sides) result.push_back(-result.back());
  }
  return result;
}

double eval_luminance(const Bsdf& bsdf, const Vec3d& wi, const Vec3d& wo) {
  const ScaledColor<double> f = eval(bsdf, kPoint, wi, wo);
  return std::exp(f.log_scale) * luminance(f.color);
}

/// Any direction; half of them near the normal's plane.
Vec3d any_direction(Rng& rng) { return square_to_sphere(rng.uniform(), rng.uniform()); }

// Law: directions are drawn with the density that pdf says; what sample loses is missing there.
TEST(Bsdf, SampleFollowsPdf) {
  Rng rng(61, Stream::Test, 0);
  const std::vector<Named> bsdfs = scattering_bsdfs();
  const double significance = sidak(0.01, 10 * static_cast<int>(bsdfs.size()));
  for (const Named& named : bsdfs) {
    for (const Vec3d& wi : view_directions(is_transmissive(named.bsdf))) {
      // The pole of the grid is where the sharpest lobe is: the mirror direction.
      const SphereGrid grid(reflect(wi, kPoint.n), 24, 12, 2.0);
      const auto draw = [&] {
        const auto next = sample(named.bsdf, kPoint, wi, rng.uniform3());
        return next ? next->wo : Vec3d(Vec3d::Zero());
      };
      const auto density = [&](const Vec3d& wo) { return pdf(named.bsdf, kPoint, wi, wo); };
      const ChiSquareResult result = chi_square_directions(grid, 8000, draw, density);
      EXPECT_GT(result.p_value, significance)
          << named.name << " cos " << kPoint.n.dot(wi) << " chi^2 " << result.statistic << " of "
          << result.degrees;
    }
  }
}

// Law: the scattering of a sample says on which side it leaves; opaque BSDFs give nothing behind.
TEST(Bsdf, SamplesLeaveOnTheSideTheySay) {
  Rng rng(62, Stream::Test, 0);
  std::vector<Named> bsdfs = scattering_bsdfs();
  bsdfs.push_back({"conductor", Conductor{}});
  bsdfs.push_back({"dielectric", Dielectric{}});
  for (const Named& named : mixed_bsdfs()) bsdfs.push_back(named);
  for (const Named& named : bsdfs) {
    for (const Vec3d& wi : view_directions(true)) {
      const double cos_i = kPoint.n.dot(wi);
      for (int i = 0; i < 200; ++i) {
        const auto next = sample(named.bsdf, kPoint, wi, rng.uniform3());
        const bool lets_pass = has_delta(named.bsdf, Scattering::Transmission);
        if (cos_i < 0.0 && !is_transmissive(named.bsdf) && !lets_pass) {
          EXPECT_FALSE(next.has_value()) << named.name;
        }
        if (!next) continue;
        EXPECT_NEAR(next->wo.norm(), 1.0, 1e-12);
        const bool same_side = kPoint.n.dot(next->wo) * cos_i > 0.0;
        EXPECT_EQ(same_side, next->scattering == Scattering::Reflection) << named.name;
        EXPECT_TRUE(next->delta || !is_delta(named.bsdf)) << named.name;
        EXPECT_TRUE(!next->delta || has_delta(named.bsdf, next->scattering)) << named.name;
        if (next->delta) continue;
        EXPECT_GT(pdf(named.bsdf, kPoint, wi, next->wo), 0.0) << named.name;
      }
    }
  }
}

/// Index behind the surface over that before it.
double index_behind(const Bsdf& bsdf) {
  if (const auto* glass = std::get_if<RoughDielectric>(&bsdf)) return glass->eta;
  const auto* blend = std::get_if<Blend>(&bsdf);
  return blend != nullptr ? index_behind(blend->first->bsdf) : 1.0;
}

// Law: a white furnace gives back at most what it is lit with. Radiance grows as the square of the
// index, so that transmitted light counts eta^2 times.
TEST(Bsdf, WhiteFurnaceGainsNoEnergy) {
  Rng rng(63, Stream::Test, 0);
  for (const Named& named : scattering_bsdfs()) {
    for (const Vec3d& wi : view_directions(is_transmissive(named.bsdf))) {
      const double inside = index_behind(named.bsdf);
      const double eta = kPoint.n.dot(wi) > 0.0 ? inside : 1.0 / inside;
      Moments energy;
      for (int i = 0; i < 20000; ++i) {
        const auto next = sample(named.bsdf, kPoint, wi, rng.uniform3());
        if (!next) {
          energy.add(0.0);
          continue;
        }
        const double index = next->scattering == Scattering::Transmission ? eta * eta : 1.0;
        energy.add(index * eval_luminance(named.bsdf, wi, next->wo) /
                   pdf(named.bsdf, kPoint, wi, next->wo));
      }
      // Duer's model does, at grazing angles, which is what the balanced one is for.
      const auto* ward = std::get_if<Ward>(&named.bsdf);
      const bool may_gain = ward != nullptr && ward->variant == Ward::Variant::Duer;
      EXPECT_TRUE(may_gain || energy.mean() < 1.0 + 4.0 * energy.error() + 1e-3)
          << named.name << " cos " << kPoint.n.dot(wi);
      // Nor does it lose more than single scattering does.
      EXPECT_GT(energy.mean(), 0.2) << named.name << " cos " << kPoint.n.dot(wi);
    }
  }
}

// Law: a diffuse BSDF gives back its reflectance, a smooth interface R + (1 - R).
TEST(Bsdf, LosslessOnesKeepAllEnergy) {
  Rng rng(64, Stream::Test, 0);
  const Bsdf glass = Dielectric{1.5, kWhite, kWhite};
  for (const Vec3d& wi : view_directions(true)) {
    const double eta = kPoint.n.dot(wi) > 0.0 ? 1.5 : 1.0 / 1.5;
    const auto energy = [&](Scattering scattering) {
      const ScaledColor<double> f = eval_delta(glass, kPoint, wi, scattering);
      const double index = scattering == Scattering::Transmission ? eta * eta : 1.0;
      const double e = index * std::exp(f.log_scale) * luminance(f.color);
      // The weight of a delta sample is eval_delta over its probability; here they are equal.
      EXPECT_NEAR(e, delta_probability(glass, kPoint, wi, scattering), 1e-12);
      return e;
    };
    EXPECT_NEAR(energy(Scattering::Reflection) + energy(Scattering::Transmission), 1.0, 1e-12);
  }
  Moments diffuse;
  const Vec3d wi = view_directions(false)[2];
  for (int i = 0; i < 100; ++i) {
    const auto next = sample(Diffuse{kWhite}, kPoint, wi, rng.uniform3());
    ASSERT_TRUE(next.has_value());
    diffuse.add(eval_luminance(Diffuse{kWhite}, wi, next->wo) /
                pdf(Diffuse{kWhite}, kPoint, wi, next->wo));
  }
  EXPECT_NEAR(diffuse.mean(), 1.0, 1e-12);
}

/// f without the cosine, over the square of the index on the side of wi: what is symmetric.
double symmetric_part(const Bsdf& bsdf, const Vec3d& wi, const Vec3d& wo) {
  const double index = kPoint.n.dot(wi) < 0.0 ? index_behind(bsdf) : 1.0;
  return eval_luminance(bsdf, wi, wo) / (std::abs(kPoint.n.dot(wo)) * index * index);
}

// Law: reciprocity, f(wi, wo) / eta_i^2 = f(wo, wi) / eta_o^2 (Veach 1997, 5.2), for reflection
// and transmission.
TEST(Bsdf, Reciprocity) {
  Rng rng(65, Stream::Test, 0);
  for (const Named& named : scattering_bsdfs()) {
    int positive = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec3d wi = any_direction(rng);
      Vec3d wo = any_direction(rng);
      // Sharp lobes are met by sampling only.
      if (i % 2 == 0)
        if (const auto next = sample(named.bsdf, kPoint, wi, rng.uniform3())) wo = next->wo;
      const double forward = symmetric_part(named.bsdf, wi, wo);
      const double backward = symmetric_part(named.bsdf, wo, wi);
      // Far in the tails numbers lose their digits.
      if (forward > 1e-300) {
        EXPECT_NEAR(forward, backward, 1e-7 * forward) << named.name;
      }
      if (forward > 0.0) ++positive;
    }
    EXPECT_GT(positive, 300) << named.name;
  }
}

// Law: sample never misses light: pdf > 0 wherever eval > 0.
TEST(Bsdf, PdfCoversEval) {
  Rng rng(66, Stream::Test, 0);
  for (const Named& named : scattering_bsdfs()) {
    for (int i = 0; i < 2000; ++i) {
      const Vec3d wi = any_direction(rng);
      const Vec3d wo = any_direction(rng);
      if (eval_luminance(named.bsdf, wi, wo) > 1e-300) {
        EXPECT_GT(pdf(named.bsdf, kPoint, wi, wo), 0.0) << named.name;
      }
    }
  }
}

// Law: where the sampling is exact, eval / pdf is what is left over: the reflectance (diffuse), or
// F G1(wo) for visible normals (GGX).
TEST(Bsdf, EvalOverPdfInClosedForm) {
  Rng rng(67, Stream::Test, 0);
  const Microfacets ggx{Distribution::Ggx, 0.3, 0.15};
  const Bsdf metal = RoughConductor{ggx, {0.2, 0.2, 0.2}, {3, 3, 3}};
  const Bsdf plaster = Diffuse{Texture(Rgbd::Constant(0.7))};
  for (const Vec3d& wi : view_directions(false)) {
    for (int i = 0; i < 100; ++i) {
      const auto bounce = sample(plaster, kPoint, wi, rng.uniform3());
      ASSERT_TRUE(bounce.has_value());
      EXPECT_NEAR(eval_luminance(plaster, wi, bounce->wo) / pdf(plaster, kPoint, wi, bounce->wo),
                  0.7, 1e-9);
      const auto next = sample(metal, kPoint, wi, rng.uniform3());
      if (!next) continue;
      const double cos_ih = wi.dot((wi + next->wo).normalized());
      const double grazing = ggx.grazing(kPoint, next->wo, kPoint.n.dot(next->wo));
      const double expected = fresnel_conductor(cos_ih, 0.2, 3.0) * ggx.g1(grazing);
      EXPECT_NEAR(eval_luminance(metal, wi, next->wo) / pdf(metal, kPoint, wi, next->wo), expected,
                  1e-7 * expected);
    }
  }
}

// Law: a layer of the index outside changes nothing; one over something white is reciprocal, its
// samples bring what its integral is, and what they lose the layer holds back; and without
// absorption nothing is gained.
TEST(Bsdf, Coating) {
  Rng rng(77, Stream::Test, 0);
  const auto metal = boxed(RoughConductor{{Distribution::Ggx, 0.3}});
  const Bsdf bare = metal->bsdf;
  const Bsdf none = Coating{1.0, kWhite, Rgbd::Zero(), metal};
  for (const auto& nested : {metal, boxed(Diffuse{kWhite})}) {
    const Bsdf layer = Coating{1.5, kWhite, Rgbd{0.1, 0.1, 0.1}, nested};
    const Bsdf clear = Coating{1.5, kWhite, Rgbd::Zero(), nested};
    for (const Vec3d& wi : view_directions(false)) {
      Moments integral;
      Moments sampled;
      Moments energy;
      Moments density;
      for (int i = 0; i < 40000; ++i) {
        const Vec3d any =
            to_world(square_to_cosine_hemisphere(rng.uniform(), rng.uniform()), kPoint.n);
        const double uniform = kPi / kPoint.n.dot(any);
        EXPECT_NEAR(eval_luminance(none, wi, any), eval_luminance(bare, wi, any),
                    1e-9 * eval_luminance(bare, wi, any));
        EXPECT_NEAR(eval_luminance(layer, wi, any) * kPoint.n.dot(wi),
                    eval_luminance(layer, any, wi) * kPoint.n.dot(any),
                    1e-9 * eval_luminance(layer, wi, any));
        integral.add(uniform * eval_luminance(layer, wi, any));
        density.add(uniform * pdf(layer, kPoint, wi, any));
        const auto next = sample(layer, kPoint, wi, rng.uniform3());
        const bool scattered = next && !next->delta;
        const double f = scattered ? eval_luminance(layer, wi, next->wo) : 0.0;
        sampled.add(scattered ? f / pdf(layer, kPoint, wi, next->wo) : 0.0);
        energy.add(uniform * eval_luminance(clear, wi, any));
      }
      const double difference = integral.mean() - sampled.mean();
      EXPECT_LT(std::abs(difference), 5.0 * std::hypot(integral.error(), sampled.error()));
      const ScaledColor<double> mirror = eval_delta(clear, kPoint, wi, Scattering::Reflection);
      const double direct = std::exp(mirror.log_scale) * luminance(mirror.color);
      EXPECT_LT(energy.mean() + direct, 1.0 + 4.0 * energy.error() + 1e-6);
      EXPECT_LT(density.mean() + delta_probability(layer, kPoint, wi, Scattering::Reflection),
                1.0 + 4.0 * density.error() + 1e-6);
    }
  }
}

// Law: Phong's lobe at the mirror direction is rho_s (n + 2) / (2 pi), beside rho_d / pi.
TEST(Bsdf, PhongPeak) {
  const Bsdf phong = Phong{Texture(Rgbd::Constant(0.3)), Texture(Rgbd::Constant(0.5)), 20};
  const Vec3d wi = view_directions(false)[1];
  const Vec3d wo = reflect(wi, kPoint.n);
  EXPECT_NEAR(eval_luminance(phong, wi, wo) / kPoint.n.dot(wo),
              0.3 / kPi + 0.5 * 22.0 / (2.0 * kPi), 1e-12);
}

// Law: with delta lobes beside a density, `sample` takes each lobe with the probability it says,
// in its direction, and the density with what is left; all of what a white surface receives is
// given back, by plastic to what the diffuse base keeps for good (it is lossless and nonlinear).
TEST(Bsdf, MixturesOfDeltaLobesAndDensities) {
  Rng rng(69, Stream::Test, 0);
  for (const Named& named : mixed_bsdfs()) {
    for (const Vec3d& wi : view_directions(false)) {
      int count = 0;
      const int total = 4000;
      std::array<int, 2> taken{};
      Moments density;
      for (int i = 0; i < total; ++i) {
        const auto next = sample(named.bsdf, kPoint, wi, rng.uniform3());
        if (!next) continue;
        ++count;
        if (next->delta) {
          ++taken.at(static_cast<std::size_t>(next->scattering));
          EXPECT_LT((next->wo - delta_direction(named.bsdf, kPoint, wi, next->scattering)).norm(),
                    1e-12);
        }
        density.add(next->delta ? 0.0
                                : eval_luminance(named.bsdf, wi, next->wo) /
                                      pdf(named.bsdf, kPoint, wi, next->wo));
      }
      EXPECT_EQ(count, total) << named.name;
      double energy = density.mean();
      for (const auto scattering : {Scattering::Reflection, Scattering::Transmission}) {
        const double p = delta_probability(named.bsdf, kPoint, wi, scattering);
        EXPECT_NEAR(taken.at(static_cast<std::size_t>(scattering)), total * p,
                    5.0 * std::sqrt(total * p * (1.0 - p)) + 1e-9)
            << named.name;
        EXPECT_EQ(p > 0.0, has_delta(named.bsdf, scattering)) << named.name;
        if (p == 0.0) continue;
        const ScaledColor<double> f = eval_delta(named.bsdf, kPoint, wi, scattering);
        // Radiance grows as the square of the index.
        const double eta = scattering == Scattering::Transmission ? delta_eta(named.bsdf) : 1.0;
        energy += eta * eta * std::exp(f.log_scale) * luminance(f.color);
      }
      // The base of an index 1.2 is gray.
      EXPECT_NEAR(energy, named.name == "plastic 1.2" ? energy : 1.0,
                  5.0 * density.error() + (is_delta(named.bsdf) ? 1e-9 : 2e-3))
          << named.name << " cos " << kPoint.n.dot(wi);
      EXPECT_LT(energy, 1.0 + 5.0 * density.error() + 2e-3);
    }
  }
}

// Law: the density of a mixture is sampled by its pdf, which integrates to the share that its delta
// lobes leave.
TEST(Bsdf, DensitiesBesideDeltaLobes) {
  Rng rng(70, Stream::Test, 0);
  const std::vector<Named> bsdfs = mixed_bsdfs();
  const double significance = sidak(0.01, 5 * static_cast<int>(bsdfs.size()));
  for (const Named& named : bsdfs) {
    if (is_delta(named.bsdf)) continue;
    for (const Vec3d& wi : view_directions(false)) {
      const SphereGrid grid(kPoint.n, 24, 12, 2.0);
      const auto draw = [&] {
        const auto next = sample(named.bsdf, kPoint, wi, rng.uniform3());
        return next && !next->delta ? next->wo : Vec3d(Vec3d::Zero());
      };
      const auto density = [&](const Vec3d& wo) { return pdf(named.bsdf, kPoint, wi, wo); };
      EXPECT_GT(chi_square_directions(grid, 8000, draw, density).p_value, significance)
          << named.name << " cos " << kPoint.n.dot(wi);
      const Vec3d wo = to_world(square_to_cosine_hemisphere(0.3, 0.6), kPoint.n);
      EXPECT_NEAR(symmetric_part(named.bsdf, wi, wo), symmetric_part(named.bsdf, wo, wi), 1e-12);
    }
  }
}

// Law: the diffuse part of plastic in closed form: T_i T_o cos / (pi eta^2) rho / (1 - rho r), and
// r by Egan and Hilgeman's fit of 1973, which is good to 0.3 % about glass.
TEST(Bsdf, PlasticBase) {
  const double eta = 1.5;
  const double fit = -1.4399 / (eta * eta) + 0.7099 / eta + 0.6681 + 0.0636 * eta;
  const Plastic linear(eta, Texture(Rgbd::Constant(0.6)), kWhite, false);
  const Plastic nonlinear(eta, Texture(Rgbd::Constant(0.6)), kWhite, true);
  EXPECT_NEAR(linear.base.internal_reflectance, fit, 0.003);
  const double r = linear.base.internal_reflectance;
  const Vec3d wi = view_directions(false)[1];
  const Vec3d wo = to_world(square_to_cosine_hemisphere(0.3, 0.6), kPoint.n);
  const double t = (1.0 - fresnel_dielectric(kPoint.n.dot(wi), eta)) *
                   (1.0 - fresnel_dielectric(kPoint.n.dot(wo), eta));
  const double common = t * kPoint.n.dot(wo) / (kPi * eta * eta) * 0.6;
  EXPECT_NEAR(eval_luminance(linear, wi, wo), common / (1.0 - r), 1e-12);
  EXPECT_NEAR(eval_luminance(nonlinear, wi, wo), common / (1.0 - 0.6 * r), 1e-12);
}

// Law: a pane reflects the sum of all reflections to and fro, R + T R T + T R^3 T + ..
TEST(Bsdf, ThinPaneSumsItsReflections) {
  const Bsdf pane = ThinDielectric{1.5, kWhite, kWhite};
  for (const Vec3d& wi : view_directions(true)) {
    const double r = fresnel_dielectric(std::abs(kPoint.n.dot(wi)), 1.5);
    double sum = r;
    double within = (1.0 - r) * (1.0 - r) * r;
    for (int i = 0; i < 10000; ++i, within *= r * r) sum += within;
    const ScaledColor<double> f = eval_delta(pane, kPoint, wi, Scattering::Reflection);
    EXPECT_NEAR(std::exp(f.log_scale), sum, 1e-9);
    EXPECT_EQ(delta_direction(pane, kPoint, wi, Scattering::Transmission), -wi);
  }
}

// Law: the table of a rough coat is what sampling finds, its slope that of finite differences, and
// as the roughness vanishes it is that of a smooth one. Of no number it makes none.
TEST(RoughTransmittance, IsWhatIsNotReflected) {
  Rng rng(71, Stream::Test, 0);
  for (const auto distribution : {Distribution::Beckmann, Distribution::Ggx}) {
    const Microfacets microfacets{distribution, 0.3};
    for (const double eta : {1.5, 1.0 / 1.5}) {
      const RoughTransmittance table(microfacets, eta);
      const Bsdf glass = RoughDielectric{microfacets, eta, kWhite, kWhite};
      for (const Vec3d& wi : view_directions(false)) {
        Moments reflected;
        for (int i = 0; i < 10000; ++i) {
          const auto next = sample(glass, kPoint, wi, rng.uniform3());
          const bool counts = next && next->scattering == Scattering::Reflection;
          reflected.add(counts
                            ? eval_luminance(glass, wi, next->wo) / pdf(glass, kPoint, wi, next->wo)
                            : 0.0);
        }
        EXPECT_NEAR(table.eval(kPoint.n.dot(wi)), 1.0 - reflected.mean(),
                    5.0 * reflected.error() + 1e-3);
      }
      for (const double cosine : {0.003, 0.2503, 0.77, 0.9999}) {
        const double h = 1e-6;
        EXPECT_NEAR((table.eval(cosine + h) - table.eval(cosine - h)) / (2.0 * h),
                    table.slope(cosine), 1e-6);
      }
    }
    const RoughTransmittance smooth({distribution, 1e-3}, 1.5);
    for (const double cosine : {0.1, 0.33, 0.9})
      EXPECT_NEAR(smooth.eval(cosine), 1.0 - fresnel_dielectric(cosine, 1.5), 2e-4);
    EXPECT_NEAR(smooth.diffuse(), 1.0 - 0.0918, 1e-3);  // 2 int F cos d cos at 1.5: 9.18 %
    EXPECT_TRUE(std::isnan(smooth.eval(std::numeric_limits<double>::quiet_NaN())));
  }
}

// Law: a delta BSDF sends wi where sample does, has no density, and refraction obeys Snell's law.
TEST(Bsdf, DeltaDirections) {
  Rng rng(68, Stream::Test, 0);
  const Bsdf glass = Dielectric{1.5, kWhite, kWhite};
  const Bsdf mirror = Conductor{};
  EXPECT_TRUE(is_delta(glass) && is_delta(mirror));
  for (const Vec3d& wi : view_directions(true)) {
    int transmitted = 0;
    const int count = 4000;
    for (int i = 0; i < count; ++i) {
      const auto next = sample(glass, kPoint, wi, rng.uniform3());
      ASSERT_TRUE(next.has_value());
      const Vec3d wo = delta_direction(glass, kPoint, wi, next->scattering);
      EXPECT_LT((wo - next->wo).norm(), 1e-12);
      EXPECT_EQ(pdf(glass, kPoint, wi, wo), 0.0);
      EXPECT_FALSE(eval_luminance(glass, wi, wo) > 0.0);
      if (next->scattering != Scattering::Transmission) continue;
      ++transmitted;
      const double eta = kPoint.n.dot(wi) > 0.0 ? 1.5 : 1.0 / 1.5;
      EXPECT_LT((wi + eta * wo).cross(kPoint.n).norm(), 1e-12);
    }
    const double p = delta_probability(glass, kPoint, wi, Scattering::Transmission);
    EXPECT_NEAR(transmitted, count * p, 4.5 * std::sqrt(count * p * (1.0 - p)) + 1e-9);
    if (kPoint.n.dot(wi) <= 0.0) continue;
    EXPECT_LT((delta_direction(mirror, kPoint, wi, Scattering::Reflection) - reflect(wi, kPoint.n))
                  .norm(),
              1e-15);
    EXPECT_EQ(delta_probability(mirror, kPoint, wi, Scattering::Reflection), 1.0);
  }
}

}  // namespace
}  // namespace driftlight::test
