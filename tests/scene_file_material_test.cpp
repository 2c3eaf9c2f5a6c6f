// SPDX-License-Identifier: Apache-2.0
/// BSDFs, colours, textures and emitters of scene files.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "driftlight/scene_file.h"
#include "scene_file/metals.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::expect_near;
using test::kShape;
using test::lit;
using test::SceneDirectory;
using test::with_sensor;

constexpr double kAir = 1.000277;

/// A scene of one shape with this bsdf.
LoadedScene load_shape(const std::string& type, const std::string& bsdf) {
  const SceneDirectory directory;
  return directory.load(lit("<shape type=\"" + type + "\">" + bsdf + "</shape>"));
}

/// The BSDF of the only shape.
Bsdf load_bsdf(const std::string& bsdf) {
  const LoadedScene loaded = load_shape("sphere", bsdf);
  EXPECT_EQ(loaded.scene.bsdfs().size(), 1U);
  return loaded.scene.bsdfs()[0];
}

TEST(BsdfsXml, ReadsDiffuse) {
  const Bsdf bsdf =
      load_bsdf(R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.1, .2 0.3"/></bsdf>)");
  expect_near(std::get<Diffuse>(bsdf).reflectance.color, Rgbd(0.1, 0.2, 0.3));
}

TEST(BsdfsXml, ReadsRoughConductors) {
  const auto metal = std::get<RoughConductor>(load_bsdf(
      R"(<bsdf type="roughconductor"><string name="distribution" value="ggx"/>
         <float name="alpha" value="0.05"/><boolean name="sampleVisible" value="false"/>
         <rgb name="eta" value="0.2, 0.4, 1.4"/><rgb name="k" value="4, 2, 1.6"/>
         <float name="extEta" value="2"/><rgb name="specularReflectance" value="0.9"/></bsdf>)"));
  EXPECT_EQ(metal.microfacets.distribution, Distribution::Ggx);
  EXPECT_EQ(metal.microfacets.alpha_u, 0.05);
  expect_near(metal.eta, Rgbd(0.1, 0.2, 0.7));
  expect_near(metal.k, Rgbd(2, 1, 0.8));
  expect_near(metal.specular_reflectance.color, Rgbd(0.9, 0.9, 0.9));
}

TEST(BsdfsXml, TheDefaultMetalIsCopperInAir) {
  const auto copper = std::get<RoughConductor>(load_bsdf(R"(<bsdf type="roughconductor"/>)"));
  EXPECT_EQ(copper.microfacets.distribution, Distribution::Beckmann);
  EXPECT_EQ(copper.microfacets.alpha_v, 0.1);
  const auto named = std::get<Conductor>(
      load_bsdf(R"(<bsdf type="conductor"><string name="material" value="cu"/></bsdf>)"));
  expect_near(copper.eta, named.eta, 0.0);
  // Red is reflected best: the index falls and the extinction grows from blue to red.
  EXPECT_LT(copper.eta.x(), copper.eta.z());
  EXPECT_GT(copper.k.x(), copper.k.z());
}

TEST(BsdfsXml, KnowsPerfectMirrors) {
  const auto mirror = std::get<Conductor>(
      load_bsdf(R"(<bsdf type="conductor"><string name="material" value="none"/></bsdf>)"));
  expect_near(mirror.eta, Rgbd(0, 0, 0));
  expect_near(mirror.k, Rgbd(Rgbd::Constant(1 / kAir)));
}

// Law: at normal incidence all reflect what handbooks say of such substances: silver and alkali
// metals nearly everything, transition metals about a half, clear crystals ((n - 1) / (n + 1))^2.
TEST(BsdfsXml, EveryNamedMetalReflectsAsItShould) {
  const struct {
    double low, high;
    std::vector<std::string> names;
  } groups[] = {
      {0.85, 1.0, {"Ag", "Al", "K", "Li", "Na"}},
      {0.6, 0.85, {"Au", "Cr", "Cu", "Hg", "Ir", "Ni", "Rh"}},
      {0.4, 0.65, {"Be", "Mo", "Nb", "TiC", "TiN", "V", "VC", "VN", "W"}},
      {0.15, 0.45, {"a-C", "AlAs", "AlSb", "d-C", "TiO2"}},
      {0.065, 0.085, {"CsI", "MgO"}},
  };
  std::size_t count = 0;
  for (const auto& group : groups) {
    for (const std::string& name : group.names) {
      const auto metal = std::get<Conductor>(load_bsdf(
          R"(<bsdf type="conductor"><string name="material" value=")" + name + R"("/></bsdf>)"));
      // Not by channel: in the sRGB of a spectrum as it is equal energy is pinkish.
      const double reflectance = fresnel_conductor(1.0, Rgbd(Rgbd::Constant(metal.eta.mean())),
                                                   Rgbd(Rgbd::Constant(metal.k.mean())))
                                     .x();
      EXPECT_GT(reflectance, group.low) << name;
      EXPECT_LT(reflectance, group.high) << name;
      ++count;
    }
  }
  EXPECT_EQ(count, metals().size());
}

TEST(BsdfsXml, NamesOfMetalsMayEndInTheirSource) {
  const auto load = [](const std::string& name) {
    return std::get<Conductor>(load_bsdf(
        R"(<bsdf type="conductor"><string name="material" value=")" + name + R"("/></bsdf>)"));
  };
  expect_near(load("Ni_palik").eta, load("Ni").eta, 0.0);
  expect_near(load("na_palik").k, load("Na").k, 0.0);
}

TEST(BsdfsXml, ReadsDielectrics) {
  const auto window = std::get<Dielectric>(load_bsdf(R"(<bsdf type="dielectric"/>)"));
  EXPECT_NEAR(window.eta, 1.5046 / kAir, 1e-12);
  const auto gem = std::get<Dielectric>(load_bsdf(
      R"(<bsdf type="dielectric"><string name="intIOR" value="Diamond"/>
         <float name="extIOR" value="1.5"/>
         <rgb name="specularTransmittance" value="0.1, 0.2, 0.3"/></bsdf>)"));
  EXPECT_NEAR(gem.eta, 2.419 / 1.5, 1e-12);
  expect_near(gem.specular_transmittance.color, Rgbd(0.1, 0.2, 0.3));
  expect_near(gem.specular_reflectance.color, Rgbd(1, 1, 1));
}

TEST(BsdfsXml, ReadsRoughDielectrics) {
  const auto glass = std::get<RoughDielectric>(load_bsdf(
      R"(<bsdf type="roughdielectric"><float name="alphaU" value="0.3"/>
         <float name="alphaV" value="0.2"/></bsdf>)"));
  EXPECT_EQ(glass.microfacets.alpha_u, 0.3);
  EXPECT_EQ(glass.microfacets.alpha_v, 0.2);
  EXPECT_NEAR(glass.eta, 1.5046 / kAir, 1e-12);
}

TEST(BsdfsXml, ReadsWard) {
  const auto plain = std::get<Ward>(load_bsdf("<bsdf type=\"ward\"/>"));
  EXPECT_EQ(plain.variant, Ward::Variant::Balanced);
  EXPECT_EQ(plain.alpha_u, 0.1);
  EXPECT_EQ(plain.alpha_v, 0.1);
  expect_near(plain.diffuse_reflectance.color, Rgbd(0.5, 0.5, 0.5));
  expect_near(plain.specular_reflectance.color, Rgbd(0.2, 0.2, 0.2));
  const auto rough =
      std::get<Ward>(load_bsdf(R"(<bsdf type="ward"><string name="variant" value="ward-duer"/>
                   <float name="alphaU" value="0.3"/></bsdf>)"));
  EXPECT_EQ(rough.variant, Ward::Variant::Duer);
  EXPECT_EQ(rough.alpha_u, 0.3);
  EXPECT_EQ(rough.alpha_v, 0.1);
  const auto both = std::get<Ward>(load_bsdf(
      R"(<bsdf type="ward"><float name="alpha" value="0.2"/><float name="alphaV" value="0.4"/>
         </bsdf>)"));
  EXPECT_EQ(both.alpha_u, 0.2);
  EXPECT_EQ(both.alpha_v, 0.4);
}

TEST(BsdfsXml, ReadsCoatings) {
  const auto coating = std::get<Coating>(load_bsdf(
      R"(<bsdf type="coating"><float name="intIOR" value="1.6"/><float name="extIOR" value="1"/>
         <float name="thickness" value="2"/><rgb name="sigmaA" value="0.1, 0.2, 0.3"/>
         <bsdf type="roughconductor"/></bsdf>)"));
  EXPECT_EQ(coating.eta, 1.6);
  expect_near(coating.absorption, Rgbd(0.2, 0.4, 0.6));
  EXPECT_TRUE(std::holds_alternative<RoughConductor>(coating.nested->bsdf));
  EXPECT_THROW(load_bsdf(R"(<bsdf type="coating"><bsdf type="dielectric"/></bsdf>)"), SceneError);
  EXPECT_THROW(load_bsdf(R"(<bsdf type="coating"/>)"), SceneError);
}

TEST(BsdfsXml, ReadsPhong) {
  const std::string colors = R"(<rgb name="diffuseReflectance" value="0.6, 0.1, 0"/>
                                <rgb name="specularReflectance" value="0.6, 0.2, 0.3"/>)";
  const auto scaled = std::get<Phong>(load_bsdf("<bsdf type=\"phong\">" + colors + "</bsdf>"));
  EXPECT_EQ(scaled.exponent, 30);
  const double factor = 0.99 / 1.2;
  expect_near(scaled.diffuse_reflectance.color, Rgbd(factor * Rgbd(0.6, 0.1, 0)));
  expect_near(scaled.specular_reflectance.color, Rgbd(factor * Rgbd(0.6, 0.2, 0.3)));
  const auto kept = std::get<Phong>(load_bsdf(
      "<bsdf type=\"phong\"><boolean name=\"ensureEnergyConservation\" value=\"false\"/>" + colors +
      "</bsdf>"));
  expect_near(kept.specular_reflectance.color, Rgbd(0.6, 0.2, 0.3));
}

TEST(BsdfsXml, ReadsPlastics) {
  const auto plastic = std::get<Plastic>(load_bsdf(R"(<bsdf type="plastic"/>)"));
  EXPECT_NEAR(plastic.eta, 1.49 / kAir, 1e-12);
  EXPECT_FALSE(plastic.base.nonlinear);
  expect_near(plastic.base.reflectance.color, Rgbd(0.5, 0.5, 0.5));
  expect_near(plastic.specular_reflectance.color, Rgbd(1, 1, 1));
  const auto rough = std::get<RoughPlastic>(load_bsdf(
      R"(<bsdf type="roughplastic"><float name="alpha" value="0.2"/>
         <string name="distribution" value="ggx"/><float name="intIOR" value="1.9"/>
         <boolean name="nonlinear" value="true"/>
         <rgb name="diffuseReflectance" value="0.1, 0.2, 0.3"/></bsdf>)"));
  EXPECT_EQ(rough.microfacets.alpha_u, 0.2);
  EXPECT_EQ(rough.microfacets.distribution, Distribution::Ggx);
  EXPECT_NEAR(rough.eta, 1.9 / kAir, 1e-12);
  EXPECT_TRUE(rough.base.nonlinear);
  expect_near(rough.base.reflectance.color, Rgbd(0.1, 0.2, 0.3));
}

TEST(BsdfsXml, ReadsPanesAndWhatOnlyLetsPass) {
  const auto pane = std::get<ThinDielectric>(
      load_bsdf(R"(<bsdf type="thindielectric"><float name="intIOR" value="1.5"/></bsdf>)"));
  EXPECT_NEAR(pane.eta, 1.5 / kAir, 1e-12);
  const auto nothing = std::get<Mask>(load_bsdf(R"(<bsdf type="null"/>)"));
  expect_near(nothing.opacity.color, Rgbd(0, 0, 0));
  EXPECT_EQ(nothing.nested, nullptr);
}

TEST(BsdfsXml, MasksEachSide) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(
      R"(<shape type="sphere"><bsdf type="mask"><bsdf type="diffuse"/></bsdf></shape>
         <shape type="sphere"><bsdf type="mask"><rgb name="opacity" value="0.2"/>
           <bsdf type="twosided"><bsdf type="phong"/></bsdf></bsdf></shape>
         <shape type="sphere"><bsdf type="mask"><bsdf type="thindielectric"/></bsdf></shape>)"));
  const auto& bsdfs = loaded.scene.bsdfs();
  const auto material = [&](std::size_t shape) {
    return loaded.scene.materials()[loaded.scene.shapes()[shape].material];
  };
  const auto& front = std::get<Mask>(bsdfs[material(0).front]);
  expect_near(front.opacity.color, Rgbd(0.5, 0.5, 0.5));
  EXPECT_TRUE(std::holds_alternative<Diffuse>(front.nested->bsdf));
  EXPECT_EQ(std::get<Mask>(bsdfs[*material(0).back]).nested, nullptr);
  const auto& back = std::get<Mask>(bsdfs[*material(1).back]);
  expect_near(back.opacity.color, Rgbd(0.2, 0.2, 0.2));
  EXPECT_TRUE(std::holds_alternative<Phong>(back.nested->bsdf));
  EXPECT_FALSE(material(2).back.has_value());
}

TEST(BsdfsXml, ScalesReflectanceAboveOneAndSaysSo) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(
      R"(<shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="2, 1, 0"/></bsdf>
         </shape>)"));
  expect_near(std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance.color, Rgbd(0.99, 0.495, 0));
  EXPECT_EQ(loaded.notices.size(), 1U);
}

TEST(BsdfsXml, ScalesOpacityAboveOneAndSaysSo) {
  const LoadedScene loaded = load_shape(
      "sphere",
      R"(<bsdf type="mask"><rgb name="opacity" value="2, 1, 0"/><bsdf type="diffuse"/></bsdf>)");
  expect_near(std::get<Mask>(loaded.scene.bsdfs()[0]).opacity.color, Rgbd(0.99, 0.495, 0));
  ASSERT_EQ(loaded.notices.size(), 1U);
  EXPECT_NE(loaded.notices[0].find("opacity"), std::string::npos);
}

TEST(BsdfsXml, OpaqueBsdfsHaveNoBackUnlessTwoSided) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(
      R"(<bsdf type="diffuse" id="red"><rgb name="reflectance" value="1, 0, 0"/></bsdf>
         <shape type="sphere"><ref id="red"/></shape>
         <shape type="sphere"><bsdf type="twosided"><ref id="red"/></bsdf></shape>
         <shape type="sphere"><bsdf type="twosided"><bsdf type="phong"/><ref id="red"/></bsdf>
         </shape>)"));
  const auto material = [&](std::size_t shape) {
    return loaded.scene.materials()[loaded.scene.shapes()[shape].material];
  };
  const auto& bsdfs = loaded.scene.bsdfs();
  EXPECT_FALSE(material(0).back.has_value());
  ASSERT_TRUE(material(1).back.has_value());
  EXPECT_TRUE(std::holds_alternative<Diffuse>(bsdfs[*material(1).back]));
  ASSERT_TRUE(material(2).back.has_value());
  EXPECT_TRUE(std::holds_alternative<Phong>(bsdfs[material(2).front]));
  EXPECT_TRUE(std::holds_alternative<Diffuse>(bsdfs[*material(2).back]));
}

TEST(BsdfsXml, ReadsBlends) {
  const auto blend = std::get<Blend>(load_bsdf(
      R"(<bsdf type="blendbsdf"><rgb name="weight" value="0.3, 0.6, 0.9"/>
         <bsdf type="diffuse"/><bsdf type="dielectric"/></bsdf>)"));
  EXPECT_NEAR(blend.weight.color[0], 0.6, 1e-12);
  EXPECT_TRUE(std::holds_alternative<Diffuse>(blend.first->bsdf));
  EXPECT_TRUE(std::holds_alternative<Dielectric>(blend.second->bsdf));
  EXPECT_TRUE(is_transmissive(blend));
  const std::string nested = R"(<bsdf type="diffuse"/><bsdf type="phong"/></bsdf>)";
  const Bsdf plain = load_bsdf(R"(<bsdf type="blendbsdf">)" + nested);
  EXPECT_NEAR(std::get<Blend>(plain).weight.color[0], 0.5, 1e-12);
  const LoadedScene full =
      load_shape("sphere", R"(<bsdf type="blendbsdf"><float name="weight" value="1.5"/>)" + nested);
  EXPECT_EQ(std::get<Blend>(full.scene.bsdfs()[0]).weight.color[0], 1.0);
  EXPECT_EQ(full.notices.size(), 1U);
}

// Law: a blend of what has two sides has two sides; black is blended where only one has.
TEST(BsdfsXml, BlendsBothSides) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(
      R"(<shape type="sphere"><bsdf type="blendbsdf"><float name="weight" value="0.25"/>
           <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.4"/></bsdf>
           </bsdf><bsdf type="roughconductor"/></bsdf></shape>)"));
  const Material& material = loaded.scene.materials()[0];
  ASSERT_TRUE(material.back.has_value());
  const auto& back = std::get<Blend>(loaded.scene.bsdfs()[*material.back]);
  EXPECT_EQ(back.weight.color[0], 0.25);
  expect_near(std::get<Diffuse>(back.first->bsdf).reflectance.color, Rgbd(0.4, 0.4, 0.4));
  expect_near(std::get<Diffuse>(back.second->bsdf).reflectance.color, Rgbd(0, 0, 0));
}

// Law: a mixture is the weighted sum of its parts.
TEST(BsdfsXml, MixturesAreWeightedSums) {
  const Bsdf mixture = load_bsdf(
      R"(<bsdf type="mixturebsdf"><string name="weights" value="0.2; 0.3, 0.4"/>
         <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
         <bsdf type="phong"/>
         <bsdf type="diffuse"><rgb name="reflectance" value="0.9"/></bsdf></bsdf>)");
  const Bsdf phong = load_bsdf(R"(<bsdf type="phong"/>)");
  const SurfacePoint<double> at{Vec3d::UnitZ(), Vec2d::Zero()};
  const Vec3d wi = Vec3d(0.3, 0.1, 1).normalized();
  const Vec3d wo = Vec3d(-0.2, -0.3, 1).normalized();
  const auto value = [&](const Bsdf& bsdf) {
    const ScaledColor<double> f = eval(bsdf, at, wi, wo);
    return std::exp(f.log_scale) * luminance(f.color);
  };
  const double expected = (0.2 * 0.5 + 0.4 * 0.9) * wo.z() / kPi + 0.3 * value(phong);
  EXPECT_NEAR(value(mixture), expected, 1e-6 * expected);
}

/// The material of the only shape, a rectangle.
Material load_material(const std::string& bsdf) {
  const LoadedScene loaded = load_shape("rectangle", bsdf);
  EXPECT_EQ(loaded.scene.materials().size(), 1U);
  return loaded.scene.materials()[0];
}

TEST(BsdfsXml, ReadsBumpMaps) {
  const Material material = load_material(
      R"(<bsdf type="bumpmap"><float name="scale" value="-3"/><texture type="scale">
         <float name="scale" value="0.2"/><texture type="checkerboard"/></texture>
         <bsdf type="diffuse"/></bsdf>)");
  ASSERT_NE(material.relief, nullptr);
  EXPECT_EQ(material.relief->kind, Relief::Kind::Bumps);
  EXPECT_EQ(material.relief->scale, -3.0);
  expect_near(material.relief->texture.scale, Rgbd(0.2, 0.2, 0.2));
}

// Law: a map goes through what is around it; both sides share it.
TEST(BsdfsXml, MapsMayBeNested) {
  const std::string map =
      R"(<bsdf type="normalmap"><texture name="normalmap" type="checkerboard"/>
         <bsdf type="diffuse"/></bsdf>)";
  const Material twosided = load_material(R"(<bsdf type="twosided">)" + map + "</bsdf>");
  ASSERT_NE(twosided.relief, nullptr);
  EXPECT_EQ(twosided.relief->kind, Relief::Kind::Normals);
  EXPECT_TRUE(twosided.back.has_value());
  EXPECT_NE(load_material(R"(<bsdf type="mask">)" + map + "</bsdf>").relief, nullptr);
}

TEST(BsdfsXml, NoticesWhatNormalMapsLeaveOut) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(
      lit(R"(<shape type="rectangle"><bsdf type="normalmap"><texture type="checkerboard"/>
             <boolean name="useShadowingFunction" value="true"/><bsdf type="diffuse"/></bsdf>
             </shape>)"));
  ASSERT_EQ(loaded.notices.size(), 1U);
  EXPECT_NE(loaded.notices[0].find("useShadowingFunction"), std::string::npos);
}

// Law: a <ref> in a map may name its texture or its bsdf, in any order.
TEST(BsdfsXml, MapsReferToTexturesAndBsdfs) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(
      R"(<texture type="gridtexture" id="grid"/><bsdf type="conductor" id="metal"/>
         <shape type="rectangle"><bsdf type="bumpmap"><ref id="metal"/><ref id="grid"/></bsdf>
         </shape><shape type="rectangle"><ref id="metal"/></shape>)"));
  ASSERT_EQ(loaded.scene.materials().size(), 2U);
  ASSERT_NE(loaded.scene.materials()[0].relief, nullptr);
  EXPECT_TRUE(loaded.scene.materials()[0].relief->texture.pattern.has_value());
  EXPECT_EQ(loaded.scene.materials()[1].relief, nullptr);
}

TEST(BsdfsXml, ShapesShareReferredMaterials) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(
      R"(<bsdf type="diffuse" id="a"/><bsdf type="diffuse" id="unused"/>
         <shape type="sphere"><ref id="a"/></shape><shape type="sphere"><ref id="a"/></shape>)"));
  EXPECT_EQ(loaded.scene.bsdfs().size(), 1U);
  EXPECT_EQ(loaded.scene.shapes()[0].material, loaded.scene.shapes()[1].material);
}

TEST(ColorXml, ReadsEveryNotation) {
  const auto color = [](const std::string& element) {
    return std::get<Diffuse>(load_bsdf("<bsdf type=\"diffuse\">" + element + "</bsdf>"))
        .reflectance.color;
  };
  expect_near(color(R"(<rgb name="reflectance" value="0.4"/>)"), Rgbd(0.4, 0.4, 0.4));
  expect_near(color(R"(<rgb name="reflectance" value="#3366ff"/>)"), Rgbd(0.2, 0.4, 1));
  expect_near(color(R"(<srgb name="reflectance" value="0.5, 0, 1"/>)"), Rgbd(0.2140411, 0, 1),
              1e-6);
  expect_near(color(R"(<spectrum name="reflectance" value="0.7"/>)"), Rgbd(0.7, 0.7, 0.7));
  expect_near(color(R"(<spectrum name="reflectance" value=".1 .2 .3"/>)"), Rgbd(0.1, 0.2, 0.3));
  expect_near(color(R"(<spectrum name="reflectance" value="360:0.5, 830:0.5"/>)"),
              Rgbd(0.6024, 0.4742, 0.4544), 5e-4);
}

TEST(EmittersXml, ReadsAreaEmitters) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(with_sensor(
      R"(<shape type="sphere"/><shape type="sphere"><emitter type="area">
         <rgb name="radiance" value="1, 2, 3"/><float name="samplingWeight" value="2"/></emitter>
         </shape>)"));
  ASSERT_EQ(loaded.scene.emitters().size(), 1U);
  const auto& area = std::get<AreaEmitter>(loaded.scene.emitters()[0]);
  expect_near(area.radiance, Rgbd(1, 2, 3));
  EXPECT_EQ(area.shape, 1U);
}

/// A textured one emits in the mean what its texture does, and where that says.
TEST(EmittersXml, ReadsTexturedAreaEmitters) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(with_sensor(
      R"(<shape type="rectangle"><emitter type="area"><texture name="radiance" type="checkerboard">
         <rgb name="color0" value="3, 2, 0"/><rgb name="color1" value="1, 0, 0"/></texture>
         </emitter></shape>)"));
  ASSERT_EQ(loaded.scene.emitters().size(), 1U);
  const auto& area = std::get<AreaEmitter>(loaded.scene.emitters()[0]);
  expect_near(area.radiance, Rgbd(2, 1, 0));
  expect_near(area.radiance_at({0.25, 0.25}), Rgbd(3, 2, 0));
  expect_near(area.radiance_at({0.75, 0.25}), Rgbd(1, 0, 0));
  EXPECT_TRUE(loaded.scene.shapes()[0].textured);
  EXPECT_FALSE(loaded.scene.shapes()[0].bent_emission);
}

TEST(EmittersXml, ReadsPoints) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(with_sensor(
      R"(<emitter type="point"><point name="position" x="1" y="2" z="3"/>
         <spectrum name="intensity" value="4"/></emitter>
         <emitter type="point"><transform name="toWorld"><translate x="5"/></transform></emitter>
         <shape type="sphere"/>)"));
  const auto& first = std::get<PointEmitter>(loaded.scene.emitters()[0]);
  expect_near(first.position, Vec3d(1, 2, 3));
  expect_near(first.intensity, Rgbd(4, 4, 4));
  const auto& second = std::get<PointEmitter>(loaded.scene.emitters()[1]);
  expect_near(second.position, Vec3d(5, 0, 0));
  expect_near(second.intensity, Rgbd(1, 1, 1));
}

TEST(EmittersXml, ReadsSpots) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(with_sensor(
      R"(<emitter type="spot"><transform name="toWorld">
         <lookat origin="1, 2, 3" target="1, 0, 3" up="0, 0, 1"/></transform>
         <rgb name="intensity" value="4, 5, 6"/><float name="cutoffAngle" value="30"/>
         <float name="beamWidth" value="12"/><float name="samplingWeight" value="1"/></emitter>
         <emitter type="spot"/>
         <emitter type="spot"><float name="cutoffAngle" value="40"/></emitter>
         <shape type="sphere"/>)"));
  const auto& first = std::get<SpotEmitter>(loaded.scene.emitters()[0]);
  expect_near(first.position(), Vec3d(1, 2, 3));
  expect_near(first.axis(), Vec3d(0, -1, 0));
  expect_near(first.intensity(), Rgbd(4, 5, 6));
  EXPECT_NEAR(first.cutoff(), kPi / 6.0, 1e-12);
  EXPECT_NEAR(first.beam_width(), kPi / 15.0, 1e-12);
  const auto& second = std::get<SpotEmitter>(loaded.scene.emitters()[1]);
  expect_near(second.position(), Vec3d(0, 0, 0));
  expect_near(second.axis(), Vec3d(0, 0, 1));
  expect_near(second.intensity(), Rgbd(1, 1, 1));
  EXPECT_NEAR(second.cutoff(), kPi / 9.0, 1e-12);
  EXPECT_NEAR(second.beam_width(), kPi / 12.0, 1e-12);
  const auto& third = std::get<SpotEmitter>(loaded.scene.emitters()[2]);
  EXPECT_NEAR(third.beam_width(), kPi / 6.0, 1e-12);
}

TEST(EmittersXml, ReadsDirectionals) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(with_sensor(
      R"(<emitter type="directional"><vector name="direction" x="3" y="0" z="-4"/>
         <spectrum name="irradiance" value="2"/></emitter>
         <emitter type="directional"><transform name="toWorld"><rotate y="1" angle="90"/>
         <scale value="3"/><translate x="7"/></transform></emitter>
         <emitter type="directional"/><shape type="sphere"/>)"));
  const auto& first = std::get<DirectionalEmitter>(loaded.scene.emitters()[0]);
  expect_near(first.direction, Vec3d(0.6, 0, -0.8));
  expect_near(first.irradiance, Rgbd(2, 2, 2));
  const auto& second = std::get<DirectionalEmitter>(loaded.scene.emitters()[1]);
  expect_near(second.direction, Vec3d(1, 0, 0));
  expect_near(second.irradiance, Rgbd(1, 1, 1));
  expect_near(std::get<DirectionalEmitter>(loaded.scene.emitters()[2]).direction, Vec3d(0, 0, 1));
}

TEST(EmittersXml, ReadsConstants) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(with_sensor(
      kShape + R"(<emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>)"));
  expect_near(std::get<ConstantEnvironment>(loaded.scene.emitters()[0]).radiance,
              Rgbd(0.5, 0.5, 0.5));
}

/// Writes an image of three channels.
template <class T>
void write_image(const std::filesystem::path& file, int width, int height,
                 const std::vector<T>& values, OIIO::TypeDesc type) {
  const auto output = OIIO::ImageOutput::create(file.string());
  ASSERT_TRUE(output);
  ASSERT_TRUE(output->open(file.string(), OIIO::ImageSpec(width, height, 3, type)));
  ASSERT_TRUE(output->write_image(type, values.data()));
  ASSERT_TRUE(output->close());
}

TEST(EmittersXml, ReadsEnvironmentMaps) {
  const SceneDirectory directory;
  // Two rows of four texels; only the one at x = 2 of the upper row is lit: directions around
  // u = 0.625, that is atan2(x, -z) = -3/8 of a turn, or -x, +z, above the horizon.
  std::vector<float> texels(24, 0.0F);
  texels[6] = 1.0F;
  write_image(directory.path() / "sky.exr", 4, 2, texels, OIIO::TypeDesc::FLOAT);
  const LoadedScene loaded = directory.load(
      with_sensor(kShape + R"(<emitter type="envmap"><string name="filename" value="sky.exr"/>
         <float name="scale" value="3"/><transform name="toWorld"><rotate y="1" angle="90"/>
         <translate x="7"/></transform></emitter>)"));
  const auto& sky = std::get<EnvironmentMap>(loaded.scene.emitters()[0]);
  const double sine = std::sqrt(0.5);
  const Vec3d in_map = Vec3d(-sine * sine, sine, sine * sine);
  const Vec3d in_world(in_map.z(), in_map.y(), -in_map.x());  // turned by 90 degrees about y
  expect_near(sky.eval(in_world), Rgbd(3, 0, 0), 1e-6);
}

TEST(TexturesXml, ReadsBitmapsFromTheTopAndUndoesTheirGamma) {
  const SceneDirectory directory;
  write_image<unsigned char>(directory.path() / "two.png", 1, 2, {128, 0, 255, 64, 64, 64},
                             OIIO::TypeDesc::UINT8);
  const auto texture = [&](const std::string& properties) {
    const LoadedScene loaded = directory.load(lit(
        R"(<texture type="bitmap" id="t"><string name="filename" value="two.png"/>)" + properties +
        R"(</texture><shape type="sphere"><bsdf type="diffuse"><ref name="reflectance" id="t"/>
           </bsdf></shape>)"));
    return std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance;
  };
  const double encoded = 128.0 / 255.0;
  const Texture srgb = texture("");
  EXPECT_NEAR(srgb.bitmap->at(0, 0).x(), std::pow((encoded + 0.055) / 1.055, 2.4), 1e-6);
  EXPECT_FLOAT_EQ(srgb.bitmap->at(0, 0).z(), 1.0F);
  EXPECT_EQ(srgb.bitmap->at(0, 1).x(), srgb.bitmap->at(0, 1).z());
  const Texture power = texture(R"(<float name="gamma" value="2.2"/>
      <float name="uvscale" value="4"/><float name="vscale" value="5"/>
      <float name="uoffset" value="0.5"/>)");
  EXPECT_NEAR(power.bitmap->at(0, 0).x(), std::pow(encoded, 2.2), 1e-6);
  EXPECT_EQ(power.uv_to_texture, Eigen::Matrix2d(Vec2d(4, 5).asDiagonal()));
  expect_near(power.uv_offset, Vec2d(0.5, 0));
}

TEST(TexturesXml, FloatImagesAreLinearAndScaledWhenTooBright) {
  const SceneDirectory directory;
  write_image<float>(directory.path() / "bright.exr", 1, 1, {0.5F, 1.0F, 2.0F},
                     OIIO::TypeDesc::FLOAT);
  const LoadedScene loaded = directory.load(lit(
      R"(<shape type="sphere"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">
         <string name="filename" value="bright.exr"/><string name="filterType" value="bilinear"/>
         </texture></bsdf></shape>)"));
  const Texture& texture = std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance;
  EXPECT_FLOAT_EQ(texture.bitmap->at(0, 0).x(), 0.5F);
  EXPECT_NEAR(texture.scale.x(), 0.99 / 2.0, 1e-12);
}

}  // namespace
}  // namespace driftlight
