// SPDX-License-Identifier: Apache-2.0
#include "cli/gradient_report.h"

#include <fmt/format.h>

namespace driftlight::cli {

namespace {

using Json = nlohmann::ordered_json;

/// Median and maximum in one digit each; the order of magnitude is what tells.
std::string errors(const QuantitySummary& s) {
  return s.paths > 0 ? fmt::format("{:>6.0e} {:>5.0e}", s.median, s.maximum)
                     : fmt::format("{:>6} {:>5}", "-", "-");
}

std::string row(const std::string& name, const ClassRecord& record) {
  std::string text = fmt::format("{:<46} {:>7}", name, record.paths());
  for (const Quantity quantity : kQuantities) text += " " + errors(record.summary(quantity));
  return text + fmt::format(" {:>9}\n", record.worst());
}

std::string header() {
  std::string text = fmt::format("{:<56}{:<26}{:<26}{}\n", "", "gradient, jets against",
                                 "Jacobian, jets against", "divergence,");
  text += fmt::format("{:<56}{:<13}{:<13}{:<13}{:<13}{}\n", "", "hand", "Ridders", "hand",
                      "Ridders", "against exact");
  text += fmt::format("{:<46} {:>7}", "class", "paths");
  for (std::size_t i = 0; i < kQuantityCount; ++i)
    text += fmt::format(" {:>6} {:>5}", "median", "max");
  return text + fmt::format(" {:>9}\n", "worst");
}

Json to_json(const ClassRecord& record) {
  Json json{{"paths", record.paths()}, {"worst", record.worst()}};
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary s = record.summary(quantity);
    json[std::string(name(quantity))] = {{"paths", s.paths},   {"compared", s.compared},
                                         {"kinks", s.kinks},   {"undecided", s.undecided},
                                         {"median", s.median}, {"maximum", s.maximum},
                                         {"worst", s.worst}};
  }
  return json;
}

Json to_json(const ClassRecords& records) {
  Json json = Json::object();
  for (const auto& [name, record] : records) json[name] = to_json(record);
  return json;
}

Json to_json(const GradientFailure& failure) {
  using Kind = GradientFailure::Kind;
  Json json{{"quantity", name(failure.quantity)}, {"what", describe(failure)}};
  if (failure.kind != Kind::SetAside) json["class"] = failure.path_class;
  if (failure.kind == Kind::Error) {
    json["error"] = failure.value;
    json["path"] = failure.index;
  }
  return json;
}

}  // namespace

std::string title(Quantity quantity) {
  switch (quantity) {
    case Quantity::GradientHand:
      return "gradient, jets against hand";
    case Quantity::GradientRidders:
      return "gradient, jets against Ridders";
    case Quantity::JacobianHand:
      return "Jacobian, jets against hand";
    case Quantity::JacobianRidders:
      return "Jacobian, jets against Ridders";
    case Quantity::Divergence:
      return "divergence, against exact";
  }
  return {};
}

std::string table_text(const GradientTable& table) {
  std::string text = header();
  for (const auto& [name, record] : table.features()) text += row(name, record);
  text += row("all", table.all());
  text += fmt::format("\n{:<32} {:>9} {:>9} {:>9} {:>10} {:>7} {:>10} {:>9}\n", "relative error",
                      "median", "maximum", "tolerance", "compared", "kinks", "undecided", "worst");
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary s = table.all().summary(quantity);
    if (s.paths == 0) continue;
    text += fmt::format("{:<32} {:>9.1e} {:>9.1e} {:>9.0e} {:>10} {:>7} {:>10} {:>9}\n",
                        title(quantity), s.median, s.maximum, tolerance(quantity), s.compared,
                        s.kinks, s.undecided, s.worst);
  }
  return text;
}

std::string summary_line(const GradientTable& table) {
  std::string text = fmt::format("gradients checked at {} states", table.all().paths());
  const char* separator = ", largest errors: ";
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary s = table.all().summary(quantity);
    if (s.paths == 0) continue;
    text += fmt::format("{}{} {:.1e}", separator, name(quantity), s.maximum);
    separator = ", ";
  }
  return text;
}

Json to_json(const GradientTable& table) {
  Json tolerances;
  for (const Quantity quantity : kQuantities)
    tolerances[std::string(name(quantity))] = tolerance(quantity);
  Json failures = Json::array();
  for (const GradientFailure& failure : table.failures()) failures.push_back(to_json(failure));
  return {{"passed", failures.empty()},
          {"failures", failures},
          {"tolerances", tolerances},
          {"all", to_json(table.all())},
          {"features", to_json(table.features())},
          {"classes", to_json(table.classes())}};
}

std::string describe(const GradientFailure& failure) {
  using Kind = GradientFailure::Kind;
  switch (failure.kind) {
    case Kind::Error:
      return fmt::format("{}: the relative error {:.2g} of a path of '{}' is above {:.0e}",
                         title(failure.quantity), failure.value, failure.path_class,
                         tolerance(failure.quantity));
    case Kind::NotCompared:
      return fmt::format("{}: no path of '{}' could be compared", title(failure.quantity),
                         failure.path_class);
    case Kind::SetAside:
      return fmt::format("{}: {:.1f} % of the coordinates could not be compared",
                         title(failure.quantity), 100.0 * failure.value);
  }
  return {};
}

}  // namespace driftlight::cli
