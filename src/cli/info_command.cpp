// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "cli/commands.h"
#include "cli/max_depth.h"
#include "cli/print.h"
#include "cli/scene.h"
#include "cli/scene_limits.h"
#include "driftlight/options.h"

namespace driftlight::cli {

namespace {

std::string row(std::string_view name, const std::string& text) {
  return fmt::format("{:<11} {}\n", name, text);
}

/// How many objects there are of each kind, by index of the variant.
template <std::size_t N>
using Counts = std::array<int, N>;

template <class... Kinds>
Counts<sizeof...(Kinds)> count_kinds(std::span<const std::variant<Kinds...>> objects) {
  Counts<sizeof...(Kinds)> counts{};
  for (const auto& object : objects) ++counts.at(object.index());
  return counts;
}

/// "3 diffuse, 1 phong"
template <std::size_t N>
std::string list(const Counts<N>& counts, const std::array<std::string_view, N>& names) {
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < N; ++i)
    if (counts.at(i) > 0) texts.push_back(fmt::format("{} {}", counts.at(i), names.at(i)));
  return texts.empty() ? "none" : fmt::format("{}", fmt::join(texts, ", "));
}

std::string list_shapes(std::span<const Shape> shapes) {
  constexpr std::array<std::string_view, 4> kNames{"mesh", "sphere", "disk", "cylinder"};
  Counts<4> counts{};
  std::size_t triangles = 0;
  for (const Shape& shape : shapes) {
    ++counts.at(shape.geometry.index());
    if (const auto* mesh = std::get_if<TriangleMesh>(&shape.geometry))
      triangles += mesh->triangles.size();
  }
  return fmt::format("{} ({} triangles)", list(counts, kNames), triangles);
}

/// "2 bitmap (64 x 64, 1024 x 512), 1 checkerboard"; a bitmap that several materials share is one.
std::string list_textures(const Scene& scene) {
  constexpr std::array<std::string_view, 2> kPatterns{"checkerboard", "grid"};
  Counts<2> patterns{};
  std::set<const Bitmap*> seen;
  std::vector<std::string> sizes;
  const auto add = [&](const Texture& texture) {
    if (texture.pattern) ++patterns.at(static_cast<std::size_t>(texture.pattern->layout));
    const Bitmap* const bitmap = texture.bitmap.get();
    if (bitmap != nullptr && seen.insert(bitmap).second)
      sizes.push_back(fmt::format("{} x {}", bitmap->width, bitmap->height));
  };
  for_each_texture(scene, add);
  const std::string others = list(patterns, kPatterns);
  if (sizes.empty()) return others;
  const std::string bitmaps = fmt::format("{} bitmap ({})", sizes.size(), fmt::join(sizes, ", "));
  return others == "none" ? bitmaps : bitmaps + ", " + others;
}

/// Field of view across the film, and where the camera is.
std::string describe_camera(const Camera& camera) {
  if (camera.is_orthographic())
    return fmt::format("orthographic, {:.4g} across, at ({:.4g}, {:.4g}, {:.4g})",
                       2.0 * camera.half_width * camera.scale, camera.origin.x(), camera.origin.y(),
                       camera.origin.z());
  const double degrees = 360.0 * kInvPi * std::atan(camera.half_width);
  std::string text = fmt::format("perspective, {:.4g} degrees across, at ({:.4g}, {:.4g}, {:.4g})",
                                 degrees, camera.origin.x(), camera.origin.y(), camera.origin.z());
  if (camera.has_lens())
    text += fmt::format(", lens of radius {:.4g} in focus at depth {:.4g}", camera.lens_radius,
                        camera.focus_depth);
  return text;
}

std::string describe_bounds(const Scene& scene) {
  const Vec3d& center = scene.center();
  return fmt::format("sphere of radius {:.4g} around ({:.4g}, {:.4g}, {:.4g})", scene.radius(),
                     center.x(), center.y(), center.z());
}

std::string depth_text(const LoadedScene& loaded) {
  const MaxDepth depth = max_depth(loaded, LangevinOptions{}.max_depth);
  return depth.notice.empty() ? fmt::format("{} edges", depth.edges)
                              : fmt::format("{} edges ({})", depth.edges, depth.notice);
}

std::string sample_text(const LoadedScene& loaded) {
  return loaded.sample_count
             ? fmt::format("{} per pixel, the default of --spp", *loaded.sample_count)
             : "not given";
}

/// The integrator's line, and below it one line an option, in columns.
template <class Options>
std::string describe_integrator(std::string_view name, std::string_view method) {
  Options defaults;
  std::vector<std::array<std::string, 4>> rows;
  std::array<std::size_t, 4> widths{};
  for (const OptionEntry& option : entries(defaults)) {
    const std::string condition =
        option.condition ? fmt::format("with {}: ", option.condition->text) : "";
    rows.push_back({std::string(option.name), option.values, "default " + option.get(),
                    condition + std::string(option.help)});
    for (std::size_t i = 0; i < widths.size(); ++i)
      widths.at(i) = std::max(widths.at(i), rows.back().at(i).size());
  }
  std::string lines = fmt::format("{}: {}\n", name, method);
  for (const auto& row : rows)
    lines += fmt::format("  {:<{}}  {:<{}}  {:<{}}  {}\n", row[0], widths[0], row[1], widths[1],
                         row[2], widths[2], row[3]);
  return lines;
}

}  // namespace

void run(const InfoCommand& command) {
  const LoadedScene loaded = load(command.scene);
  const Scene& scene = loaded.scene;
  constexpr std::array<std::string_view, 13> kBsdfs{
      "diffuse", "conductor",    "roughconductor", "dielectric", "roughdielectric", "phong", "ward",
      "plastic", "roughplastic", "thindielectric", "mask",       "coating",         "blend"};
  constexpr std::array<std::string_view, 7> kEmitters{
      "area", "point", "constant", "envmap", "spot", "directional", "blurred area"};
  std::string text = row("scene", command.scene.file.string());
  text += row("film",
              fmt::format("{} x {} pixels", scene.camera().film_width, scene.camera().film_height));
  text += row("camera", describe_camera(scene.camera()));
  text += row("max depth", depth_text(loaded));
  text += row("samples", sample_text(loaded));
  text += row("bounds", describe_bounds(scene));
  text += row("shapes", list_shapes(scene.shapes()));
  text += row("bsdfs", list(count_kinds(scene.bsdfs()), kBsdfs));
  text += row("textures", list_textures(scene));
  text += row("emitters", list(count_kinds(scene.emitters()), kEmitters));
  text += row("memory", fmt::format("{:.3g} MB of meshes and bitmaps, without Embree's trees",
                                    1e-6 * static_cast<double>(memory_of(scene))));
  text += row("hash", identity_of(command.scene, loaded).hash);
  for (const IntegratorLimits& limits : limits_of(scene))
    text += row(name_of(limits.integrator), limits.text);
  for (const std::string& notice : loaded.notices) text += row("notice", notice);
  print(text);
}

void run(const IntegratorsCommand& /*command*/) {
  print(
      describe_integrator<LangevinOptions>(
          "langevin",
          "Metropolis-adjusted Langevin sampling of light paths (Ershov, Frolov, Nikolaev and "
          "Voloboy 2023, doi 10.20948/prepr-2023-63); perturbations are those of mlt; "
          "delayed_rejection after Tierney and Mira "
          "1999, Green and Mira 2001, and Rioux-Lavoie et al. 2020, doi 10.1145/3388538") +
      describe_integrator<PssmltOptions>(
          "pssmlt",
          "primary sample space Metropolis light transport with bidirectional path tracing "
          "(Kelemen, Szirmay-Kalos, Antal and Csonka 2002, doi 10.1111/1467-8659.t01-1-00703)") +
      describe_integrator<MmltOptions>(
          "mmlt",
          "multiplexed Metropolis light transport (Hachisuka, Kaplanyan and Dachsbacher 2014, "
          "doi 10.1145/2601097.2601138)") +
      describe_integrator<H2mcOptions>(
          "h2mc",
          "mmlt with Gaussian steps from the Hessian by Hamiltonian dynamics (Li, Lehtinen, "
          "Ramamoorthi, Jakob and Durand 2015, doi 10.1145/2816795.2818084)") +
      describe_integrator<LmcOptions>(
          "lmc",
          "mmlt with Langevin steps and a diagonal preconditioner that adapts to gradients (Luan, "
          "Zhao, Bala and Gkioulekas 2020, doi 10.1145/3386569.3392382)") +
      describe_integrator<MalaOptions>(
          "mala",
          "mmlt with the Langevin steps of langevin: drift, and a matrix from the constraints of "
          "the "
          "path, in primary sample space (Ershov, Frolov, Nikolaev and Voloboy 2023, "
          "doi 10.20948/prepr-2023-63)") +
      describe_integrator<MltOptions>(
          "mlt",
          "Metropolis light transport by bidirectional mutations and lens, caustic and multi-chain "
          "perturbations of paths (Veach and Guibas 1997, doi 10.1145/258734.258775), and by "
          "manifold perturbations (Jakob and Marschner 2012, doi 10.1145/2185520.2185554)") +
      describe_integrator<ErptOptions>(
          "erpt",
          "energy redistribution path tracing: bidirectional samples whose light short chains of "
          "the perturbations of mlt spread (Cline, Talbot and Egbert 2005, "
          "doi 10.1145/1073204.1073330)") +
      describe_integrator<PathOptions>(
          "path",
          "path tracing with next-event estimation (Kajiya 1986, doi 10.1145/15922.15902; "
          "Veach 1997)") +
      describe_integrator<BdptOptions>(
          "bdpt",
          "bidirectional path tracing with all connections (Lafortune and Willems 1993; "
          "Veach 1997)") +
      describe_integrator<LightOptions>(
          "light",
          "light tracing; what is seen by way of smooth mirrors and glass is missing (Dutre, "
          "Lafortune and Willems 1993; Veach 1997)"));
}

}  // namespace driftlight::cli
