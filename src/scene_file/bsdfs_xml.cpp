// SPDX-License-Identifier: Apache-2.0
#include "bsdfs_xml.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bsdf_textures.h"
#include "color_xml.h"
#include "properties.h"
#include "refractive_indices.h"
#include "relief_xml.h"
#include "text.h"
#include "textures_xml.h"

namespace driftlight {
namespace {

/// Mitsuba's remedy for materials that reflect more than they receive: textures that act together
/// are scaled so that their maxima sum to 0.99, unless ensureEnergyConservation is false.
void conserve_energy(Properties& properties, LoadContext& context,
                     std::initializer_list<Texture*> textures,
                     const std::string& what = "reflectance") {
  if (!properties.boolean("ensureEnergyConservation", true)) return;
  Rgbd sum = Rgbd::Zero();
  for (const Texture* texture : textures) sum += texture->maximum_color();
  if (sum.maxCoeff() <= 1.0) return;
  const double factor = 0.99 / sum.maxCoeff();
  for (Texture* texture : textures) scale(*texture, Rgbd::Constant(factor));
  context.notice(properties.element(), "the " + what + " of " + properties.description() +
                                           " exceeds 1 and is scaled by " + std::to_string(factor) +
                                           ", as in Mitsuba");
}

/// Reads a texture that acts alone.
Texture read_scattering(Properties& properties, LoadContext& context, std::string_view name,
                        const Rgbd& fallback) {
  Texture texture = read_textured(properties, name, fallback, context);
  conserve_energy(properties, context, {&texture});
  return texture;
}

/// Roughness along the tangent and across it.
struct Alpha {
  double u, v;
};
/// `alpha` of both, or each by its name. Those of a ward are `alpha` where they are not given.
Alpha read_alpha(Properties& properties, LoadContext& context) {
  constexpr double kLeast = 1e-4;
  const bool by_axis = properties.has("alphaU") || properties.has("alphaV");
  if (by_axis && properties.type() != "ward") {
    if (properties.has("alpha"))
      properties.fail("alpha", "give either 'alpha' or 'alphaU' and 'alphaV'");
    if (!(properties.has("alphaU") && properties.has("alphaV")))
      properties.element().fail("'alphaU' and 'alphaV' need each other");
  }
  const double alpha = properties.non_negative("alpha", 0.1);
  const double u = properties.non_negative("alphaU", alpha);
  const double v = properties.non_negative("alphaV", alpha);
  if (std::min(u, v) < kLeast)
    context.notice(properties.element(), "roughness is raised to 0.0001, as in Mitsuba");
  return {std::max(u, kLeast), std::max(v, kLeast)};
}

Microfacets read_microfacets(Properties& properties, LoadContext& context) {
  const std::string name =
      properties.choice("distribution", "beckmann", {"beckmann", "ggx", "phong", "as"});
  properties.ignore({"sampleVisible"});
  const Alpha alpha = read_alpha(properties, context);
  if (name == "ggx") return {Distribution::Ggx, alpha.u, alpha.v};
  if (name == "beckmann") return {Distribution::Beckmann, alpha.u, alpha.v};
  // An exponent is not negative.
  return {Distribution::Phong, std::min(alpha.u, 1.0), std::min(alpha.v, 1.0)};
}

Bsdf read_diffuse(Properties& properties, LoadContext& context) {
  const bool long_name = properties.has("diffuseReflectance") && !properties.has("reflectance");
  return Diffuse{read_scattering(
      properties, context, long_name ? "diffuseReflectance" : "reflectance", Rgbd::Constant(0.5))};
}

/// eta and k of a metal: by name, where given by value, over the index outside, which in Mitsuba 3
/// is that of vacuum. Without a name Mitsuba 0.6 takes copper, Mitsuba 3 what reflects everything.
void read_metal(Properties& properties, LoadContext& context, Rgbd& eta, Rgbd& k) {
  const bool newer = properties.dialect() == Dialect::Mitsuba3;
  const std::string name = properties.text("material").value_or(newer ? "none" : "Cu");
  eta = Rgbd::Zero();
  k = Rgbd::Ones();
  if (lower_case(name) != "none") {
    const MetalIndex metal = find_metal(properties, name);
    eta = metal.eta;
    k = metal.k;
    if (!properties.has("eta") || !properties.has("k"))
      context.notice(properties.element(), "metal '" + name + "' as measured by " + metal.source +
                                               "; Mitsuba's own table may differ a little");
  }
  const double outside = newer ? 1.0 : read_index(properties, "extEta", "air");
  eta = properties.color("eta", eta) / outside;
  k = properties.color("k", k) / outside;
}

Bsdf read_conductor(Properties& properties, LoadContext& context) {
  Conductor bsdf;
  read_metal(properties, context, bsdf.eta, bsdf.k);
  bsdf.specular_reflectance = read_scattering(properties, context, "specularReflectance", kWhite);
  return bsdf;
}

Bsdf read_rough_conductor(Properties& properties, LoadContext& context) {
  RoughConductor bsdf;
  bsdf.microfacets = read_microfacets(properties, context);
  read_metal(properties, context, bsdf.eta, bsdf.k);
  bsdf.specular_reflectance = read_scattering(properties, context, "specularReflectance", kWhite);
  return bsdf;
}

/// Fills in what smooth and rough dielectrics have in common.
template <class D>
D read_interface(Properties& properties, LoadContext& context) {
  D bsdf;
  bsdf.eta = read_index(properties, "intIOR", "bk7") / read_index(properties, "extIOR", "air");
  bsdf.specular_reflectance = read_scattering(properties, context, "specularReflectance", kWhite);
  bsdf.specular_transmittance =
      read_scattering(properties, context, "specularTransmittance", kWhite);
  return bsdf;
}

Bsdf read_dielectric(Properties& properties, LoadContext& context) {
  return read_interface<Dielectric>(properties, context);
}

Bsdf read_rough_dielectric(Properties& properties, LoadContext& context) {
  auto bsdf = read_interface<RoughDielectric>(properties, context);
  bsdf.microfacets = read_microfacets(properties, context);
  if (bsdf.eta == 1.0)
    properties.element().fail("'intIOR' and 'extIOR' of a roughdielectric must differ");
  return bsdf;
}

Bsdf read_phong(Properties& properties, LoadContext& context) {
  Phong bsdf;
  bsdf.diffuse_reflectance =
      read_textured(properties, "diffuseReflectance", Rgbd::Constant(0.5), context);
  bsdf.specular_reflectance =
      read_textured(properties, "specularReflectance", Rgbd::Constant(0.2), context);
  bsdf.exponent = properties.non_negative("exponent", 30.0);
  conserve_energy(properties, context, {&bsdf.diffuse_reflectance, &bsdf.specular_reflectance});
  return bsdf;
}

Bsdf read_ward(Properties& properties, LoadContext& context) {
  Ward bsdf;
  const std::string variant =
      properties.choice("variant", "balanced", {"ward", "ward-duer", "balanced"});
  bsdf.variant = variant == "ward"        ? Ward::Variant::Ward
                 : variant == "ward-duer" ? Ward::Variant::Duer
                                          : Ward::Variant::Balanced;
  const Alpha alpha = read_alpha(properties, context);
  bsdf.alpha_u = alpha.u;
  bsdf.alpha_v = alpha.v;
  bsdf.diffuse_reflectance =
      read_textured(properties, "diffuseReflectance", Rgbd::Constant(0.5), context);
  bsdf.specular_reflectance =
      read_textured(properties, "specularReflectance", Rgbd::Constant(0.2), context);
  conserve_energy(properties, context, {&bsdf.diffuse_reflectance, &bsdf.specular_reflectance});
  return bsdf;
}

/// Fills in what smooth and rough plastics have in common; `make` takes eta, diffuse and specular
/// reflectance, and `nonlinear`.
template <class Make>
Bsdf read_coated(Properties& properties, LoadContext& context, const Make& make) {
  const double eta =
      read_index(properties, "intIOR", "polypropylene") / read_index(properties, "extIOR", "air");
  if (eta == 1.0)
    properties.element().fail("'intIOR' and 'extIOR' of " + properties.description() +
                              " must differ");
  const Texture diffuse =
      read_scattering(properties, context, "diffuseReflectance", Rgbd::Constant(0.5));
  const Texture specular = read_scattering(properties, context, "specularReflectance", kWhite);
  return make(eta, diffuse, specular, properties.boolean("nonlinear", false));
}

Bsdf read_plastic(Properties& properties, LoadContext& context) {
  return read_coated(properties, context, [](auto&&... of) { return Plastic(of...); });
}

Bsdf read_rough_plastic(Properties& properties, LoadContext& context) {
  const Microfacets microfacets = read_microfacets(properties, context);
  if (!microfacets.is_isotropic())
    properties.fail("alphaV", "must equal 'alphaU': rough plastics are isotropic");
  return read_coated(properties, context,
                     [&](auto&&... of) { return RoughPlastic(microfacets, of...); });
}

Bsdf read_thin_dielectric(Properties& properties, LoadContext& context) {
  const auto bsdf = read_interface<ThinDielectric>(properties, context);
  if (bsdf.eta == 1.0)
    properties.element().fail("'intIOR' and 'extIOR' of a thindielectric must differ");
  return bsdf;
}

Bsdf read_null(Properties&, LoadContext&) { return Mask{Texture(Rgbd::Zero()), nullptr}; }

std::shared_ptr<const BsdfBox> boxed(const Bsdf& bsdf) {
  return std::make_shared<const BsdfBox>(BsdfBox{bsdf});
}

/// By colour in Mitsuba 0.6, one number in 3.
Texture read_opacity(Properties& properties, LoadContext& context) {
  constexpr double kDefault = 0.5;
  if (properties.dialect() == Dialect::Mitsuba3)
    return read_share(properties, "opacity", kDefault, context);
  Texture opacity = read_scalar(properties, "opacity", kDefault, context);
  conserve_energy(properties, context, {&opacity}, "opacity");
  if (opacity.maximum() > 1.0) properties.fail("opacity", "must be between 0 and 1");
  return opacity;
}

/// Each side masks its own BSDF. Black back sides let pass too.
Surface read_mask(Properties& properties, LoadContext& context) {
  const std::vector<Element> nested = properties.nested({"bsdf", "ref"});
  if (nested.size() != 1) properties.element().fail("a mask needs one nested bsdf");
  const std::shared_ptr<Surface> surface = read_surface(nested.front(), context);
  if (delta_eta(surface->front) != 1.0)
    nested.front().fail("a smooth dielectric cannot be nested in a mask: a thindielectric can");
  const Texture opacity = read_opacity(properties, context);
  const auto masked = [&](const Bsdf& bsdf) { return Mask{opacity, boxed(bsdf)}; };
  Surface result{masked(surface->front), std::nullopt, std::nullopt, surface->relief};
  if (surface->back)
    result.back = masked(*surface->back);
  else if (!is_transmissive(surface->front))
    result.back = Mask{opacity, nullptr};
  return result;
}

/// Blends each side. A side that only one of the two has is black in the other.
Surface blend(const Element& element, const Texture& weight, const Surface& first,
              const Surface& second) {
  const bool transmits = is_transmissive(first.front) || is_transmissive(second.front);
  if (transmits && (first.back || second.back))
    element.fail("what transmits cannot be blended with what is twosided or a mask");
  if (first.relief != second.relief)
    element.fail("bump and normal maps cannot be blended; a blend can be nested in one");
  const auto through = [](const Surface& s) {
    return has_delta(s.front, Scattering::Transmission);
  };
  if (through(first) && through(second) && delta_eta(first.front) != delta_eta(second.front))
    element.fail("smooth bsdfs that refract differently cannot be blended");
  Surface result{Blend{weight, boxed(first.front), boxed(second.front)}, std::nullopt, std::nullopt,
                 first.relief};
  const Bsdf black = Diffuse{Texture(Rgbd::Zero())};
  if (first.back || second.back)
    result.back =
        Blend{weight, boxed(first.back.value_or(black)), boxed(second.back.value_or(black))};
  const int lobes = std::max(lobe_count(result.front), result.back ? lobe_count(*result.back) : 0);
  if (lobes > kMaxLobes)
    element.fail("a blend of " + std::to_string(lobes) +
                 " diffuse and glossy lobes; the limit is " + std::to_string(kMaxLobes));
  return result;
}

/// Only Mitsuba 0.6 has a default for the weight.
Surface read_blend(Properties& properties, LoadContext& context) {
  if (properties.dialect() == Dialect::Mitsuba3 && !properties.has("weight"))
    properties.element().fail("a blendbsdf needs a 'weight'");
  const Texture weight = read_share(properties, "weight", 0.5, context);
  const std::vector<Element> nested = properties.nested({"bsdf", "ref"});
  if (nested.size() != 2) properties.element().fail("a blendbsdf needs two nested bsdfs");
  const std::shared_ptr<Surface> first = read_surface(nested[0], context);
  const std::shared_ptr<Surface> second = read_surface(nested[1], context);
  return blend(properties.element(), weight, *first, *second);
}

/// sum_i w_i f_i, one blend after the other; black where the weights sum to less than 1.
Surface read_mixture(Properties& properties, LoadContext& context) {
  std::vector<double> weights;
  for (const std::string& part : split(properties.required_text("weights"), ",; \t\r\n")) {
    const std::optional<double> weight = parse_number(part);
    if (!weight || !(*weight >= 0.0))
      properties.fail("weights", "'" + part + "' is not a number that is at least 0");
    weights.push_back(*weight);
  }
  const std::vector<Element> nested = properties.nested({"bsdf", "ref"});
  if (nested.empty() || nested.size() != weights.size())
    properties.fail("weights", std::to_string(weights.size()) + " weights for " +
                                   std::to_string(nested.size()) + " nested bsdfs");
  double sum = 0;
  for (const double weight : weights) sum += weight;
  if (!(sum > 0.0)) properties.fail("weights", "must not all be 0");
  if (sum > 1.0 && properties.boolean("ensureEnergyConservation", true)) {
    context.notice(properties.element(),
                   "the weights of " + properties.description() + " are scaled to a sum of 1");
    for (double& weight : weights) weight /= sum;
    sum = 1.0;
  }
  if (sum > 1.0 + 1e-9) properties.fail("weights", "must not sum to more than 1");
  const auto mix = [&](const Surface& first, const Surface& second, double weight) {
    return blend(properties.element(), Texture(Rgbd::Constant(weight)), first, second);
  };
  Surface result = *read_surface(nested[0], context);
  result.material.reset();
  double so_far = weights[0];
  for (std::size_t i = 1; i < nested.size(); ++i) {
    const std::shared_ptr<Surface> next = read_surface(nested[i], context);
    so_far += weights[i];
    result = mix(result, *next, so_far > 0.0 ? weights[i] / so_far : 0.0);
  }
  const Surface black{Diffuse{Texture(Rgbd::Zero())}, std::nullopt, std::nullopt, result.relief};
  return sum < 1.0 - 1e-9 ? mix(result, black, 1.0 - sum) : result;
}

Surface read_coating(Properties& properties, LoadContext& context) {
  Coating coating;
  coating.eta = read_index(properties, "intIOR", "bk7") / read_index(properties, "extIOR", "air");
  if (!(coating.eta > 1.0)) properties.element().fail("'intIOR' of a coating must exceed 'extIOR'");
  coating.specular_reflectance =
      read_scattering(properties, context, "specularReflectance", kWhite);
  coating.absorption =
      properties.non_negative("thickness", 1.0) * properties.color("sigmaA", Rgbd::Zero());
  const std::vector<Element> nested = properties.nested({"bsdf", "ref"});
  if (nested.size() != 1) properties.element().fail("a coating needs one nested bsdf");
  const std::shared_ptr<Surface> surface = read_surface(nested.front(), context);
  const bool transmits = has_delta(surface->front, Scattering::Transmission);
  if (surface->back || transmits || is_transmissive(surface->front))
    nested.front().fail("only a one-sided bsdf without transmission can be nested in a coating");
  if (surface->relief != nullptr)
    nested.front().fail("bump and normal maps cannot be nested in a coating; it can be in one");
  coating.nested = boxed(surface->front);
  return {coating, std::nullopt, std::nullopt};
}

Surface read_two_sided(Properties& properties, LoadContext& context) {
  const std::vector<Element> nested = properties.nested({"bsdf", "ref"});
  if (nested.empty() || nested.size() > 2)
    properties.element().fail("a twosided bsdf needs one or two nested bsdfs");
  std::vector<Bsdf> sides;
  std::shared_ptr<const Relief> relief;
  for (const Element& element : nested) {
    const std::shared_ptr<Surface> side = read_surface(element, context);
    const bool transmits = has_delta(side->front, Scattering::Transmission);
    if (side->back || transmits || is_transmissive(side->front))
      element.fail("only a one-sided bsdf without transmission can be nested in twosided");
    if (!sides.empty() && side->relief != relief)
      element.fail("bump and normal maps cannot differ by side; a twosided can be nested in one");
    relief = side->relief;
    sides.push_back(side->front);
  }
  properties.ignore({"ensureEnergyConservation"});
  // In Mitsuba 3 it allows what transmits to be nested, which has failed above.
  if (properties.dialect() == Dialect::Mitsuba3) properties.boolean("allowTransmission", false);
  return {sides.front(), sides.back(), std::nullopt, relief};
}

template <Bsdf (*Read)(Properties&, LoadContext&)>
Surface one_sided(Properties& properties, LoadContext& context) {
  return {Read(properties, context), std::nullopt, std::nullopt};
}

using BsdfReader = Surface (*)(Properties&, LoadContext&);
constexpr std::array<std::pair<std::string_view, BsdfReader>, 18> kBsdfs{{
    {"diffuse", &one_sided<read_diffuse>},
    {"conductor", &one_sided<read_conductor>},
    {"roughconductor", &one_sided<read_rough_conductor>},
    {"dielectric", &one_sided<read_dielectric>},
    {"roughdielectric", &one_sided<read_rough_dielectric>},
    {"phong", &one_sided<read_phong>},
    {"ward", &one_sided<read_ward>},
    {"plastic", &one_sided<read_plastic>},
    {"roughplastic", &one_sided<read_rough_plastic>},
    {"thindielectric", &one_sided<read_thin_dielectric>},
    {"null", &one_sided<read_null>},
    {"mask", &read_mask},
    {"coating", &read_coating},
    {"blendbsdf", &read_blend},
    {"mixturebsdf", &read_mixture},
    {"twosided", &read_two_sided},
    {"bumpmap", &read_bump_map},
    {"normalmap", &read_normal_map},
}};

}  // namespace

std::shared_ptr<Surface> read_surface(const Element& element, LoadContext& context) {
  if (element.tag() == "ref") {
    context.objects.read_ahead(element, "bsdf",
                               [&](const Element& target) { read_surface(target, context); });
    return context.objects.resolve<std::shared_ptr<Surface>>(element, "bsdf");
  }
  if (const auto* read = context.objects.find_read<std::shared_ptr<Surface>>(element)) return *read;
  Properties properties(element);
  auto surface = std::make_shared<Surface>(find_plugin(kBsdfs, properties)(properties, context));
  properties.finish();
  context.objects.define(element, surface);
  return surface;
}

std::uint32_t material_index(Surface& surface, LoadContext& context) {
  if (!surface.material) {
    Material material{context.builder.add_bsdf(surface.front), std::nullopt, surface.relief};
    if (surface.back) material.back = context.builder.add_bsdf(*surface.back);
    surface.material = context.builder.add_material(material);
  }
  return *surface.material;
}

bool is_textured(const Surface& surface) {
  return is_textured(surface.front) || (surface.back && is_textured(*surface.back));
}

bool is_isotropic(const Surface& surface) {
  return is_isotropic(surface.front) && (!surface.back || is_isotropic(*surface.back));
}

}  // namespace driftlight
