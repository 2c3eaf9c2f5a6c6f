// SPDX-License-Identifier: Apache-2.0
#include "cli/terms_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>

namespace driftlight::cli {

namespace {

using Json = nlohmann::ordered_json;

/// A value of a term with the settings that it stands for.
struct Term {
  std::string name;
  Settings settings;
};

const std::array<Term, 4>& preconditioners() {
  static const std::array<Term, 4> terms{
      {{"identity", {{"preconditioner", "identity"}, {"scale", "0.012"}}},
       {"diagonal", {{"preconditioner", "diagonal"}, {"scale", "3"}}},
       {"constraints", {{"preconditioner", "constraints"}}},
       {"hessian", {{"preconditioner", "hessian"}, {"scale", "0.1"}}}}};
  return terms;
}

const std::array<Term, 3>& drifts() {
  static const std::array<Term, 3> terms{{{"none", {{"drift", "none"}}},
                                          {"gradient", {{"drift", "gradient"}}},
                                          {"full", {{"drift", "full"}}}}};
  return terms;
}

const std::array<Term, 2>& time_steps() {
  static const std::array<Term, 2> terms{
      {{"default", {}}, {"careful", {{"safety", "10"}, {"time_step_cap", "0.01"}}}}};
  return terms;
}

/// Whether the study sets it.
bool is_studied(const std::string& option) {
  const auto sets = [&](const Term& term) {
    return std::any_of(term.settings.begin(), term.settings.end(),
                       [&](const auto& setting) { return setting.first == option; });
  };
  const auto any_sets = [&](const auto& terms) {
    return std::any_of(terms.begin(), terms.end(), sets);
  };
  return option == "mode" || any_sets(preconditioners()) || any_sets(drifts()) ||
         any_sets(time_steps());
}

/// What both tables show of one integrator.
struct Line {
  std::string name;
  double mutations;            ///< per pixel, at equal time
  std::array<double, 2> time;  ///< relMSE and trimmed, at equal time
  double seconds;              ///< at equal mutations
  std::array<double, 2> work;  ///< relMSE and trimmed, at equal mutations
  double acceptance;           ///< of small steps, over both
};

std::array<double, 2> errors(const Json& moment) {
  const Json& kind = moment["error"].is_null() ? moment["spread"] : moment["error"];
  return {kind["relmse"].get<double>(), kind["relmse_trimmed"].get<double>()};
}

/// Their acceptance; 0 if there were none.
double small_steps(const Json& acceptance) {
  return acceptance.is_null() ? 0.0 : acceptance.value("small_step", 0.0);
}

std::vector<Line> lines_of(const Json& equal_time, const Json& equal_mutations) {
  std::vector<Line> lines;
  for (std::size_t i = 0; i < equal_time["integrators"].size(); ++i) {
    const Json& by_time = equal_time["integrators"][i];
    const Json& by_work = equal_mutations["integrators"][i];
    const Json& last = by_time["moments"].back();
    const Json& last_of_work = by_work["moments"].back();
    lines.push_back({by_time["name"].get<std::string>(), last["work"].get<double>(), errors(last),
                     last_of_work["seconds"].get<double>(), errors(last_of_work),
                     small_steps(by_work["acceptance"])});
  }
  return lines;
}

}  // namespace

std::vector<IntegratorChoice> terms_of_the_step(const Settings& shared) {
  for (const auto& [option, value] : shared)
    if (is_studied(option))
      throw UsageError(fmt::format("--study terms sets the option '{}' itself", option));
  std::vector<IntegratorChoice> choices;
  for (const Term& preconditioner : preconditioners())
    for (const Term& drift : drifts())
      for (const Term& time_step : time_steps()) {
        // Its divergence, by differences, takes hundreds of times as long as a mutation.
        if (preconditioner.name == "hessian" && drift.name == "full") continue;
        IntegratorChoice choice{
            .name = fmt::format("{}-{}-{}", preconditioner.name, drift.name, time_step.name),
            .integrator = Integrator::Langevin,
            .settings = shared};
        choice.settings.emplace_back("mode", "chain");
        for (const Term* term : {&preconditioner, &drift, &time_step})
          choice.settings.insert(choice.settings.end(), term->settings.begin(),
                                 term->settings.end());
        choices.push_back(std::move(choice));
      }
  return choices;
}

std::string terms_table(const nlohmann::ordered_json& equal_time,
                        const nlohmann::ordered_json& equal_mutations) {
  std::string text = fmt::format("{:<29} {:^32}   {:^30}\n", "", "equal time", "equal mutations");
  text += fmt::format("{:<29} {:>10} {:>10} {:>10}   {:>8} {:>10} {:>10} {:>11}\n",
                      "preconditioner-drift-step", "mut./pixel", "relMSE", "trimmed", "seconds",
                      "relMSE", "trimmed", "acceptance");
  for (const Line& line : lines_of(equal_time, equal_mutations))
    text += fmt::format(
        "{:<29} {:>10.4g} {:>10.4g} {:>10.4g}   {:>8.4g} {:>10.4g} {:>10.4g} {:>11.3g}\n",
        line.name, line.mutations, line.time[0], line.time[1], line.seconds, line.work[0],
        line.work[1], line.acceptance);
  return text;
}

std::string terms_csv(const nlohmann::ordered_json& equal_time,
                      const nlohmann::ordered_json& equal_mutations) {
  std::string text =
      "integrator,time_mutations_per_pixel,time_relmse,time_relmse_trimmed,mutations_seconds,"
      "mutations_relmse,mutations_relmse_trimmed,small_step_acceptance\n";
  for (const Line& line : lines_of(equal_time, equal_mutations))
    text += fmt::format("{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", line.name,
                        line.mutations, line.time[0], line.time[1], line.seconds, line.work[0],
                        line.work[1], line.acceptance);
  return text;
}

}  // namespace driftlight::cli
