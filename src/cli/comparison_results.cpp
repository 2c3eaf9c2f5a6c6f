// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "run_figures.h"

namespace driftlight::cli {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kConfidence = 0.95;

/// The snapshots that runs have of one moment.
std::vector<const Snapshot*> snapshots_at(const Contender& contender, double fraction) {
  std::vector<const Snapshot*> found;
  for (const Run& run : contender.runs)
    for (const Snapshot& snapshot : run.snapshots)
      if (snapshot.fraction == fraction) found.push_back(&snapshot);
  return found;
}

/// Median of `figure(x)` over all x.
template <class Range, class Figure>
double median_of(const Range& range, const Figure& figure) {
  std::vector<double> values;
  values.reserve(range.size());
  for (const auto& x : range) values.push_back(figure(x));
  return median(std::move(values));
}

/// Medians over runs, then each run's own.
Json error_json(const std::vector<const Snapshot*>& snapshots, const Image& reference) {
  std::vector<Difference> all;
  Json by_run = Json::array();
  for (const Snapshot* snapshot : snapshots) {
    const Difference d = difference(snapshot->image, reference);
    all.push_back(d);
    by_run.push_back({{"seconds", snapshot->seconds},
                      {"mse", d.mse},
                      {"relmse", d.relmse},
                      {"relmse_trimmed", d.relmse_trimmed},
                      {"mape", d.mape}});
  }
  return {{"mse", median_of(all, [](const Difference& d) { return d.mse; })},
          {"relmse", median_of(all, [](const Difference& d) { return d.relmse; })},
          {"relmse_trimmed", median_of(all, [](const Difference& d) { return d.relmse_trimmed; })},
          {"mape", median_of(all, [](const Difference& d) { return d.mape; })},
          {"by_run", by_run}};
}

/// Medians over all pairs of runs.
Json spread_json(const std::vector<const Snapshot*>& snapshots, const Image& expected) {
  std::vector<Spread> pairs;
  for (std::size_t i = 0; i < snapshots.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      pairs.push_back(spread(snapshots[i]->image, snapshots[j]->image, expected));
  if (pairs.empty()) return nullptr;
  return {{"pairs", pairs.size()},
          {"mse", median_of(pairs, [](const Spread& s) { return s.mse; })},
          {"relmse", median_of(pairs, [](const Spread& s) { return s.relmse; })},
          {"relmse_trimmed", median_of(pairs, [](const Spread& s) { return s.relmse_trimmed; })}};
}

Json moments_json(const Contender& contender, const std::vector<double>& moments,
                  const std::optional<Image>& reference, const Image& expected) {
  Json all = Json::array();
  for (const double fraction : moments) {
    const std::vector<const Snapshot*> snapshots = snapshots_at(contender, fraction);
    if (snapshots.empty()) continue;
    all.push_back({{"fraction", fraction},
                   {"runs", snapshots.size()},
                   {"seconds", median_of(snapshots, [](const Snapshot* s) { return s->seconds; })},
                   {"work", median_of(snapshots, [](const Snapshot* s) { return s->work; })},
                   {"error", reference ? error_json(snapshots, *reference) : Json()},
                   {"spread", spread_json(snapshots, expected)}});
  }
  return all;
}

Json brightness_json(const Contender& contender, const std::optional<Image>& reference) {
  Moments runs;
  for (std::size_t i = 0; i < contender.runs.size(); ++i)
    runs.add(mean_luminance(contender.final_image(i)));
  const double half = student_half_width(runs, kConfidence);
  Json json{{"mean", runs.mean()},       {"error", runs.error()},      {"confidence", kConfidence},
            {"low", runs.mean() - half}, {"high", runs.mean() + half}, {"ratio", nullptr},
            {"p_value", nullptr}};
  if (reference) {
    const double expected = mean_luminance(*reference);
    json["ratio"] = runs.mean() / expected;
    json["p_value"] = test_tiles({runs}, {expected}).p_value;
  }
  return json;
}

/// Over runs, of each tile of the final images.
std::vector<Moments> tiles_over_runs(const Contender& contender) {
  std::vector<Moments> tiles;
  for (std::size_t run = 0; run < contender.runs.size(); ++run) {
    const std::vector<double> means = tile_luminances(contender.final_image(run));
    tiles.resize(means.size());
    for (std::size_t i = 0; i < means.size(); ++i) tiles[i].add(means[i]);
  }
  return tiles;
}

std::vector<double> means_of(const std::vector<Moments>& tiles) {
  std::vector<double> means;
  means.reserve(tiles.size());
  for (const Moments& tile : tiles) means.push_back(tile.mean());
  return means;
}

Json tile_test_json(const std::vector<Moments>& tiles, const Image& reference) {
  const TileTest test = test_tiles(tiles, tile_luminances(reference));
  return {{"tiles", test.tiles},
          {"rejected", test.rejected},
          {"p_value", test.p_value},
          {"resolution", test.resolution}};
}

Json agreement_json(const Contender& contender) {
  std::vector<std::vector<std::vector<double>>> batches;
  for (const Run& run : contender.runs) {
    if (run.parts.empty()) return nullptr;
    batches.push_back(run.parts);
  }
  const Agreement result = agreement(batches);
  return {{"parts", kParts}, {"rhat", result.rhat}, {"worst", result.worst}};
}

/// Over all runs, of each kernel that has proposed anything.
Json acceptance_json(const Contender& contender) {
  Json all = Json::object();
  for (const char* kernel : {"large_step", "small_step", "second_step"}) {
    double proposed = 0;
    double accepted = 0;
    for (const Run& run : contender.runs) {
      if (!run.statistics.contains("kernels") || !run.statistics["kernels"].contains(kernel))
        continue;
      const Json& of_run = run.statistics["kernels"][kernel];
      const auto count = of_run["proposed"].get<double>();
      proposed += count;
      accepted += count * of_run["acceptance"].get<double>();
    }
    if (proposed > 0.0) all[kernel] = accepted / proposed;
  }
  return all.empty() ? Json() : all;
}

/// Median over runs, if splitting carries anything in all of them.
Json families_json(const Contender& contender) {
  std::vector<double> families;
  for (const Run& run : contender.runs) {
    if (!run.statistics.contains("splitting")) return nullptr;
    const Json& splitting = run.statistics["splitting"];
    if (splitting["lobe_sequences"].get<std::size_t>() == 0) return nullptr;
    families.push_back(splitting["effective_families"].get<double>());
  }
  return median(std::move(families));
}

Json contender_json(const Contender& contender, const std::vector<double>& moments,
                    const std::optional<Image>& reference, const Image& expected) {
  const std::vector<Moments> tiles = tiles_over_runs(contender);
  const double seconds =
      median_of(contender.runs, [](const Run& run) { return run.snapshots.back().seconds; });
  const double samples =
      effective_samples(tiles, reference ? tile_luminances(*reference) : means_of(tiles));
  const std::string stem = file_stem(contender.choice);
  Json runs = Json::array();
  for (const Run& run : contender.runs)
    runs.push_back({{"seed", run.seed},
                    {"seconds", run.snapshots.back().seconds},
                    {"work", run.snapshots.back().work},
                    {"statistics", run.statistics}});
  return {{"name", contender.choice.name},
          {"integrator", name_of(contender.choice.integrator)},
          {"settings", contender.choice.settings},
          {"options", contender.runs.front().statistics["options"]},
          {"work_in",
           counts_mutations(contender.options) ? "mutations per pixel" : "samples per pixel"},
          {"files",
           {{"exr", stem + ".exr"}, {"png", stem + ".png"}, {"error_png", stem + "_error.png"}}},
          {"moments", moments_json(contender, moments, reference, expected)},
          {"brightness", brightness_json(contender, reference)},
          {"tile_test", reference ? tile_test_json(tiles, *reference) : Json()},
          {"agreement", agreement_json(contender)},
          {"effective_samples_per_second", samples / seconds},
          {"acceptance", acceptance_json(contender)},
          {"effective_families", families_json(contender)},
          {"runs", runs}};
}

/// A figure of an object that may be null.
std::string figure(const Json& object, const char* name) {
  if (object.is_null() || object[name].is_null()) return "";
  return fmt::format("{:.6g}", object[name].get<double>());
}

/// The same, for the table.
std::string cell(const Json& object, const char* name) {
  if (object.is_null() || object[name].is_null()) return "-";
  return fmt::format("{:.4g}", object[name].get<double>());
}

}  // namespace

Image expected_image(const std::vector<Contender>& contenders,
                     const std::optional<Image>& reference) {
  if (reference) return *reference;
  std::vector<const Image*> images;
  for (const Contender& contender : contenders)
    for (std::size_t run = 0; run < contender.runs.size(); ++run)
      images.push_back(&contender.final_image(run));
  return median_image(images);
}

nlohmann::ordered_json comparison_results(const CompareCommand& command, const Work& work,
                                          const std::vector<Contender>& contenders,
                                          const std::optional<Image>& reference,
                                          const Image& expected) {
  const Image& first = contenders.front().final_image(0);
  const std::vector<double> moments = moments_of(work);
  Json all = Json::array();
  for (const Contender& contender : contenders)
    all.push_back(contender_json(contender, moments, reference, expected));
  Json budget = Json::object();
  if (work.time) budget["seconds"] = *work.time;
  if (work.samples_per_pixel) budget["samples_per_pixel"] = *work.samples_per_pixel;
  if (work.mutations_per_pixel) budget["mutations_per_pixel"] = *work.mutations_per_pixel;
  return {{"driftlight", DRIFTLIGHT_VERSION},
          {"scene", {{"file", command.scene.file.string()}, {"defines", command.scene.defines}}},
          {"image", {{"width", first.width}, {"height", first.height}}},
          {"reference", command.reference ? Json{{"file", command.reference->string()},
                                                 {"mean", mean_luminance(*reference)}}
                                          : Json()},
          {"budget", budget},
          {"runs", contenders.front().runs.size()},
          {"threads", contenders.front().runs.front().statistics["threads"]},
          {"integrators", all}};
}

std::string csv_text(const nlohmann::ordered_json& results) {
  std::string text =
      "integrator,fraction,runs,seconds,work,mse,relmse,relmse_trimmed,mape,spread_mse,"
      "spread_relmse,spread_relmse_trimmed\n";
  for (const Json& integrator : results["integrators"])
    for (const Json& moment : integrator["moments"]) {
      text += integrator["name"].get<std::string>();
      for (const char* name : {"fraction", "runs", "seconds", "work"})
        text += "," + figure(moment, name);
      for (const char* name : {"mse", "relmse", "relmse_trimmed", "mape"})
        text += "," + figure(moment["error"], name);
      for (const char* name : {"mse", "relmse", "relmse_trimmed"})
        text += "," + figure(moment["spread"], name);
      text += "\n";
    }
  return text;
}

std::string summary_text(const nlohmann::ordered_json& results) {
  std::size_t width = 10;
  for (const Json& integrator : results["integrators"])
    width = std::max(width, integrator["name"].get<std::string>().size());
  std::string text =
      fmt::format("{:<{}} {:>9} {:>10} {:>10} {:>10} {:>10} {:>10} {:>8}\n", "", width, "seconds",
                  "relMSE", "trimmed", "spread", "trimmed", "mean", "R-hat");
  for (const Json& integrator : results["integrators"]) {
    const Json& last = integrator["moments"].back();
    text +=
        fmt::format("{:<{}} {:>9} {:>10} {:>10} {:>10} {:>10} {:>10} {:>8}\n",
                    integrator["name"].get<std::string>(), width, cell(last, "seconds"),
                    cell(last["error"], "relmse"), cell(last["error"], "relmse_trimmed"),
                    cell(last["spread"], "relmse"), cell(last["spread"], "relmse_trimmed"),
                    cell(integrator["brightness"], "mean"), cell(integrator["agreement"], "rhat"));
  }
  return text;
}

std::string file_stem(const IntegratorChoice& choice) {
  std::string stem = choice.name;
  std::replace(stem.begin(), stem.end(), ':', '_');
  return stem;
}

}  // namespace driftlight::cli
