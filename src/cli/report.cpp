// SPDX-License-Identifier: Apache-2.0
#include "cli/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <thread>

#include "cli/gradient_report.h"

namespace driftlight::cli {

namespace {

using Json = nlohmann::ordered_json;

/// A number if it is written like one, else text.
Json option_value(const std::string& text) {
  double x = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, x);
  if (error != std::errc() || stop != end) return text;
  return Json::parse(text);
}

/// What all integrators report alike.
Report common_report(const std::string& integrator, const Image& image,
                     const std::vector<OptionEntry>& options, const RenderOptions& render) {
  Report report;
  std::vector<std::string> settings;
  Json values = Json::object();
  for (const OptionEntry& option : options) {
    const std::string value = option.get();
    settings.push_back(fmt::format("{}={}", option.name, value));
    values[std::string(option.name)] = option_value(value);
  }
  report.metadata = {{"Software", "driftlight " DRIFTLIGHT_VERSION},
                     {"driftlight:integrator", integrator},
                     {"driftlight:options", fmt::format("{}", fmt::join(settings, " "))},
                     {"driftlight:seed", fmt::format("{}", render.seed)}};
  const auto threads = render.threads > 0 ? static_cast<unsigned>(render.threads)
                                          : std::thread::hardware_concurrency();
  report.statistics = {{"driftlight", DRIFTLIGHT_VERSION},
                       {"integrator", integrator},
                       {"options", values},
                       {"seed", render.seed},
                       {"threads", threads},
                       {"image", {{"width", image.width}, {"height", image.height}}}};
  return report;
}

double pixel_count(const Image& image) {
  return static_cast<double>(image.width) * static_cast<double>(image.height);
}

double per_second(double count, double seconds) { return seconds > 0.0 ? count / seconds : 0.0; }

Json to_json(const KernelStatistics& kernel) {
  return {{"proposed", kernel.proposed}, {"acceptance", kernel.acceptance()}};
}

std::string describe(const char* name, const KernelStatistics& kernel) {
  return fmt::format("{}: {} proposed, acceptance {:.4f}", name, kernel.proposed,
                     kernel.acceptance());
}

std::string describe(const Rejections& r, std::uint64_t proposed) {
  const auto percent = [&](std::uint64_t n) {
    return 100.0 * static_cast<double>(n) /
           static_cast<double>(std::max<std::uint64_t>(1, proposed));
  };
  return fmt::format(
      "small steps rejected: {:.2f} % missed, {:.2f} % other lobe, {:.2f} % occluded, "
      "{:.2f} % not finite, {:.2f} % by Hastings",
      percent(r.missed), percent(r.other_lobe), percent(r.occluded), percent(r.non_finite),
      percent(r.hastings));
}

std::string path_lengths(const LangevinStatistics& s) {
  std::string text = "mutations at paths of n edges:";
  for (std::size_t n = 1; n < s.path_length.size(); ++n)
    if (s.path_length[n] > 0) text += fmt::format(" {}:{}", n, s.path_length[n]);
  return text;
}

void report_chains(const std::string& integrator, const LangevinStatistics& s, const Image& image,
                   Report& report) {
  report.empty = s.mutations == 0 && !(s.direct_samples_per_pixel > 0.0);
  const auto mutations = static_cast<double>(s.mutations);
  const double rate = per_second(mutations, s.render_seconds - s.direct_seconds);
  report.statistics.update(
      {{"b_error", s.b_error},
       {"large_step_probability", s.large_step_probability},
       {"direct", {{"mean", s.direct_mean}, {"samples_per_pixel", s.direct_samples_per_pixel}}},
       {"mutations_per_second", rate}});
  report.statistics["seconds"]["direct"] = s.direct_seconds;
  report.summary = {
      fmt::format("{}: {} x {} pixels, {} mutations ({:.4g} per pixel) in {:.2f} s, {:.4g} per "
                  "second",
                  integrator, image.width, image.height, s.mutations,
                  mutations / pixel_count(image), s.render_seconds, rate),
      fmt::format("b = {:.6g} +- {:.2g}", s.b, s.b_error)};
  if (s.direct_samples_per_pixel > 0.0)
    report.summary.push_back(
        fmt::format("direct light: mean {:.6g}, {} samples per pixel in {:.2f} s", s.direct_mean,
                    s.direct_samples_per_pixel, s.direct_seconds));
}

void report_redistribution(const std::string& integrator, const LangevinStatistics& s,
                           const Image& image, Report& report) {
  report.empty = !(s.samples_per_pixel > 0.0);
  report.statistics.update({{"samples_per_pixel", s.samples_per_pixel},
                            {"starts", s.starts},
                            {"remainder", s.remainder},
                            {"threshold", s.threshold},
                            {"perturbations", s.perturbations},
                            {"mutations_per_sample", s.mutations_per_sample},
                            {"light_subpaths", s.light_subpaths}});
  report.details.push_back(fmt::format(
      "threshold {:g}, {:g} light subpaths for each sample, at most {:g} mutations, {:g} of them "
      "perturbations",
      s.threshold, s.light_subpaths, s.mutations_per_sample, s.perturbations));
  report.summary = {
      fmt::format("{}: {} x {} pixels, {:.4g} samples and {:.4g} mutations per pixel in {:.2f} s",
                  integrator, image.width, image.height, s.samples_per_pixel,
                  static_cast<double>(s.mutations) / pixel_count(image), s.render_seconds),
      fmt::format("mean {:.6g}, {:.2f} % of it by chains from {} samples", s.b,
                  s.b > 0.0 ? 100.0 * s.remainder / s.b : 0.0, s.starts)};
}

/// Part of an image's light, resting on few families, from which on users are warned.
constexpr double kDoubtful = 0.01;

Json to_json(const LevelFigures& level) {
  return {{"particles", level.particles},
          {"died", level.died},
          {"steps", level.steps.proposed},
          {"acceptance", level.steps.acceptance()}};
}

/// Of particles, if any were.
void report_splitting(const LangevinStatistics& s, Report& report) {
  Json levels = Json::array();
  for (const LevelFigures& level : s.levels) levels.push_back(to_json(level));
  report.statistics["splitting"] = {{"mean", s.split},
                                    {"deposit", s.split_deposit},
                                    {"rate", s.split_rate},
                                    {"lobe_sequences", s.split_sequences},
                                    {"effective_families", s.effective_families},
                                    {"mean_of_few_families", s.split_of_few_families},
                                    {"levels", levels}};
  if (s.split_sequences == 0) {
    report.summary.emplace_back("splitting: nothing to gain, left to redistribution");
    return;
  }
  report.summary.push_back(fmt::format(
      "splitting: {:.2f} % of the mean, from {:.4g} effective families of {} lobe sequences, "
      "{:.3g} samples for each of the scene",
      s.b > 0.0 ? 100.0 * s.split / s.b : 0.0, s.effective_families, s.split_sequences,
      s.split_rate));
  if (s.split_of_few_families > kDoubtful * s.b)
    report.warnings.push_back(fmt::format(
        "{:.0f} % of the light rests on so few families of particles that tiles of 16 x 16 pixels "
        "are uncertain by more than a fourth; --shares tells where, a longer render helps",
        100.0 * s.split_of_few_families / s.b));
  for (std::size_t k = s.levels.size(); k-- > 0;) {
    const LevelFigures& level = s.levels[k];
    report.details.push_back(fmt::format(
        "level {}: {} particles, {:.1f} % died, {} steps, acceptance {:.3f}", k, level.particles,
        100.0 * static_cast<double>(level.died) /
            static_cast<double>(std::max<std::uint64_t>(1, level.particles)),
        level.steps.proposed, level.steps.acceptance()));
  }
}

void report_check(const GradientTable& check, Report& report) {
  report.statistics["gradient_check"] = cli::to_json(check);
  report.summary.push_back(summary_line(check));
  const auto failures = check.failures();
  if (!failures.empty()) report.failure = cli::describe(failures.front());
}

/// What all report alike that accept and reject.
Report metropolis_report(const std::string& integrator, const LangevinResult& result,
                         const std::vector<OptionEntry>& entries, const RenderOptions& render) {
  const LangevinStatistics& s = result.statistics;
  Report report = common_report(integrator, result.image, entries, render);
  report.stopped = s.stopped;
  report.metadata["driftlight:b"] = fmt::format("{}", s.b);
  report.metadata["driftlight:mutations"] = fmt::format("{}", s.mutations);
  report.statistics.update(
      {{"stopped", s.stopped},
       {"b", s.b},
       {"mutations", s.mutations},
       {"kernels", {{"large_step", to_json(s.large_step)}, {"small_step", to_json(s.small_step)}}},
       {"rejections",
        {{"missed", s.rejections.missed},
         {"other_lobe", s.rejections.other_lobe},
         {"occluded", s.rejections.occluded},
         {"non_finite", s.rejections.non_finite},
         {"hastings", s.rejections.hastings}}},
       {"seconds", {{"bootstrap", s.bootstrap_seconds}, {"render", s.render_seconds}}}});
  report.details = {describe("large steps", s.large_step), describe("small steps", s.small_step),
                    describe(s.rejections, s.small_step.proposed + s.second_step.proposed)};
  if (s.second_step.proposed > 0) {
    report.statistics["kernels"]["second_step"] = to_json(s.second_step);
    report.details.push_back(describe("second steps", s.second_step));
  }
  return report;
}

}  // namespace

Report make_report(const LangevinResult& result, const LangevinOptions& options,
                   const std::vector<OptionEntry>& entries, const RenderOptions& render) {
  const LangevinStatistics& s = result.statistics;
  Report report = metropolis_report("langevin", result, entries, render);
  if (options.mode == Mode::Chain) {
    report_chains("langevin", s, result.image, report);
    report.statistics["path_lengths"] = s.path_length;
    report.details.push_back(path_lengths(s));
  } else {
    report_redistribution("langevin", s, result.image, report);
  }
  if (options.mode == Mode::Splitting) report_splitting(s, report);
  if (result.gradient_check) report_check(*result.gradient_check, report);
  return report;
}

Report make_report(const std::string& integrator, const LangevinResult& result,
                   const std::vector<OptionEntry>& entries, const RenderOptions& render) {
  Report report = metropolis_report(integrator, result, entries, render);
  if (result.statistics.samples_per_pixel > 0.0)
    report_redistribution(integrator, result.statistics, result.image, report);
  else
    report_chains(integrator, result.statistics, result.image, report);
  return report;
}

Report make_report(const std::string& integrator, const PathResult& result,
                   const std::vector<OptionEntry>& entries, const RenderOptions& render) {
  Report report = common_report(integrator, result.image, entries, render);
  report.stopped = result.stopped;
  report.empty = !(result.samples_per_pixel > 0.0);
  report.metadata["driftlight:samples_per_pixel"] = fmt::format("{}", result.samples_per_pixel);

  const double rate =
      per_second(result.samples_per_pixel * pixel_count(result.image), result.render_seconds);
  report.statistics.update({{"stopped", result.stopped},
                            {"samples_per_pixel", result.samples_per_pixel},
                            {"samples_per_second", rate},
                            {"non_finite", result.non_finite},
                            {"seconds", {{"render", result.render_seconds}}}});
  report.summary = {fmt::format(
      "{}: {} x {} pixels, {:.4g} samples per pixel in {:.2f} s, {:.4g} samples per second",
      integrator, result.image.width, result.image.height, result.samples_per_pixel,
      result.render_seconds, rate)};
  if (result.non_finite > 0)
    report.summary.push_back(
        fmt::format("{} samples were not finite and count as no light", result.non_finite));
  return report;
}

}  // namespace driftlight::cli
