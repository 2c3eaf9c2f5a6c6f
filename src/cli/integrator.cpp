// SPDX-License-Identifier: Apache-2.0
#include "cli/integrator.h"

#include <fmt/format.h>

#include <algorithm>
#include <type_traits>

#include "cli/max_depth.h"

namespace driftlight::cli {

namespace {

constexpr double kMutationsPerPixel = 100;
constexpr int kSamplesPerPixel = 64;

int samples(const Work& work) { return work.samples_per_pixel.value_or(kSamplesPerPixel); }

double mutations(const Work& work) { return work.mutations_per_pixel.value_or(kMutationsPerPixel); }

Rendered render_by(const Scene& scene, LangevinOptions& options, const RenderOptions& how,
                   const Work& work) {
  const double amount =
      options.mode == Mode::Chain ? mutations(work) : static_cast<double>(samples(work));
  LangevinResult result = render_langevin(scene, options, how, amount);
  Report report = make_report(result, options, entries(options), how);
  return {std::move(result.image), std::move(report)};
}

LangevinResult result_of(const Scene& scene, const PssmltOptions& options, const RenderOptions& how,
                         const Work& work) {
  return render_pssmlt(scene, options, how, mutations(work));
}

LangevinResult result_of(const Scene& scene, const MmltOptions& options, const RenderOptions& how,
                         const Work& work) {
  return render_mmlt(scene, options, how, mutations(work));
}

LangevinResult result_of(const Scene& scene, const H2mcOptions& options, const RenderOptions& how,
                         const Work& work) {
  return render_h2mc(scene, options, how, mutations(work));
}

LangevinResult result_of(const Scene& scene, const LmcOptions& options, const RenderOptions& how,
                         const Work& work) {
  return render_lmc(scene, options, how, mutations(work));
}

LangevinResult result_of(const Scene& scene, const MalaOptions& options, const RenderOptions& how,
                         const Work& work) {
  return render_mala(scene, options, how, mutations(work));
}

LangevinResult result_of(const Scene& scene, const MltOptions& options, const RenderOptions& how,
                         const Work& work) {
  return render_mlt(scene, options, how, mutations(work));
}

LangevinResult result_of(const Scene& scene, const ErptOptions& options, const RenderOptions& how,
                         const Work& work) {
  return render_erpt(scene, options, how, samples(work));
}

PathResult result_of(const Scene& scene, const PathOptions& options, const RenderOptions& how,
                     const Work& work) {
  return render_path(scene, options, how, samples(work));
}

PathResult result_of(const Scene& scene, const BdptOptions& options, const RenderOptions& how,
                     const Work& work) {
  return render_bdpt(scene, options, how, samples(work));
}

PathResult result_of(const Scene& scene, const LightOptions& options, const RenderOptions& how,
                     const Work& work) {
  return render_light(scene, options, how, samples(work));
}

std::string_view name_of(const PssmltOptions& /*options*/) {
  return cli::name_of(Integrator::Pssmlt);
}
std::string_view name_of(const MmltOptions& /*options*/) { return cli::name_of(Integrator::Mmlt); }
std::string_view name_of(const H2mcOptions& /*options*/) { return cli::name_of(Integrator::H2mc); }
std::string_view name_of(const LmcOptions& /*options*/) { return cli::name_of(Integrator::Lmc); }
std::string_view name_of(const MalaOptions& /*options*/) { return cli::name_of(Integrator::Mala); }
std::string_view name_of(const MltOptions& /*options*/) { return cli::name_of(Integrator::Mlt); }
std::string_view name_of(const ErptOptions& /*options*/) { return cli::name_of(Integrator::Erpt); }
std::string_view name_of(const PathOptions& /*options*/) { return cli::name_of(Integrator::Path); }
std::string_view name_of(const BdptOptions& /*options*/) { return cli::name_of(Integrator::Bdpt); }
std::string_view name_of(const LightOptions& /*options*/) {
  return cli::name_of(Integrator::Light);
}

template <class Options>
Rendered render_by(const Scene& scene, Options& options, const RenderOptions& how,
                   const Work& work) {
  auto result = result_of(scene, options, how, work);
  Report report = make_report(std::string(name_of(options)), result, entries(options), how);
  return {std::move(result.image), std::move(report)};
}

}  // namespace

IntegratorOptions options_of(Integrator integrator) {
  switch (integrator) {
    case Integrator::Langevin:
      return LangevinOptions{};
    case Integrator::Pssmlt:
      return PssmltOptions{};
    case Integrator::Mmlt:
      return MmltOptions{};
    case Integrator::H2mc:
      return H2mcOptions{};
    case Integrator::Lmc:
      return LmcOptions{};
    case Integrator::Mala:
      return MalaOptions{};
    case Integrator::Mlt:
      return MltOptions{};
    case Integrator::Erpt:
      return ErptOptions{};
    case Integrator::Path:
      return PathOptions{};
    case Integrator::Bdpt:
      return BdptOptions{};
    case Integrator::Light:
      return LightOptions{};
  }
  return LangevinOptions{};
}

std::vector<OptionEntry> entries_of(IntegratorOptions& options) {
  return std::visit([](auto& of) { return entries(of); }, options);
}

void apply(const Settings& settings, IntegratorOptions& options) {
  const std::vector<OptionEntry> known = entries_of(options);
  for (const auto& [name, value] : settings) set_option(known, name, value);
  for (const auto& [name, value] : settings) check_condition(known, name);
}

std::string take_depth(const LoadedScene& loaded, const Settings& settings,
                       IntegratorOptions& options) {
  const bool given = std::any_of(settings.begin(), settings.end(),
                                 [](const auto& setting) { return setting.first == "max_depth"; });
  if (given) return "";
  return std::visit(
      [&](auto& of) {
        MaxDepth depth = max_depth(loaded, of.max_depth);
        of.max_depth = depth.edges;
        return std::move(depth.notice);
      },
      options);
}

std::string take_sample_count(const LoadedScene& loaded, const IntegratorOptions& options,
                              Work& work) {
  const bool given = work.time || work.samples_per_pixel;
  if (given || counts_mutations(options) || !loaded.sample_count) return "";
  work.samples_per_pixel = loaded.sample_count;
  return fmt::format(
      "{} samples per pixel, as the scene's sampler says; --spp gives another number",
      *loaded.sample_count);
}

bool counts_mutations(const IntegratorOptions& options) {
  if (const auto* langevin = std::get_if<LangevinOptions>(&options))
    return langevin->mode == Mode::Chain;
  return std::visit(
      [](const auto& of) {
        using Options = std::decay_t<decltype(of)>;
        return std::is_base_of_v<PrimaryOptions, Options> || std::is_same_v<Options, MltOptions>;
      },
      options);
}

Rendered render_with(const Scene& scene, IntegratorOptions& options, const RenderOptions& how,
                     const Work& work) {
  return std::visit([&](auto& of) { return render_by(scene, of, how, work); }, options);
}

}  // namespace driftlight::cli
