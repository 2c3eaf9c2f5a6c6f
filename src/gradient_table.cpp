// SPDX-License-Identifier: Apache-2.0
#include "driftlight/gradient_table.h"

#include <algorithm>
#include <cctype>

namespace driftlight {
namespace {

/// Part of all coordinates of a quantity, if there are enough to tell.
constexpr double kMostSetAside = 0.02;
constexpr std::uint64_t kManyCoordinates = 1000;
/// Paths that a class must have for all of them to be set aside by more than chance.
constexpr std::uint64_t kSomePaths = 5;

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

}  // namespace

double QuantitySummary::set_aside() const {
  if (coordinates() == 0) return 0.0;
  return static_cast<double>(kinks + undecided) / static_cast<double>(coordinates());
}

void ClassRecord::add(const CheckedPath& path) {
  ++paths_;
  for (std::size_t i = 0; i < kQuantityCount; ++i) {
    const Comparison& result = path.results.at(i);
    Record& record = records_.at(i);
    record.compared += static_cast<std::uint64_t>(result.compared);
    record.kinks += static_cast<std::uint64_t>(result.kinks);
    record.undecided += static_cast<std::uint64_t>(result.undecided);
    // An error may come from a coordinate that is set aside for another of its residuals.
    if (result.compared > 0 || result.error > 0.0)
      record.errors.push_back({result.error, path.index});
  }
}

QuantitySummary ClassRecord::summary(Quantity quantity) const {
  const Record& record = records_.at(static_cast<std::size_t>(quantity));
  QuantitySummary summary;
  summary.compared = record.compared;
  summary.kinks = record.kinks;
  summary.undecided = record.undecided;
  summary.paths = record.errors.size();
  if (record.errors.empty()) return summary;
  std::vector<Entry> errors = record.errors;
  const auto smaller = [](const Entry& a, const Entry& b) { return a.error < b.error; };
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end(), smaller);
  summary.median = middle->error;
  const auto worst = std::max_element(record.errors.begin(), record.errors.end(), smaller);
  summary.maximum = worst->error;
  summary.worst = worst->index;
  return summary;
}

std::uint64_t ClassRecord::worst() const {
  double largest = -1;
  std::uint64_t index = 0;
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary s = summary(quantity);
    const double part = s.maximum / tolerance(quantity);
    if (s.paths == 0 || part <= largest) continue;
    largest = part;
    index = s.worst;
  }
  return index;
}

bool ByNameAndNumber::operator()(const std::string& a, const std::string& b) const {
  std::size_t i = 0;
  while (i < a.size() && i < b.size() && a[i] == b[i]) ++i;
  if (i == a.size() || i == b.size()) return a.size() < b.size();
  while (i > 0 && is_digit(a[i - 1])) --i;
  if (!is_digit(a[i]) || !is_digit(b[i])) return a.substr(i) < b.substr(i);
  const auto number = [i](const std::string& text) {
    std::size_t end = i;
    while (end < text.size() && is_digit(text[end])) ++end;
    return text.substr(i, end - i);
  };
  const std::string x = number(a);
  const std::string y = number(b);
  if (x.size() != y.size()) return x.size() < y.size();
  return a.substr(i) < b.substr(i);
}

void GradientTable::add(const CheckedPath& path) {
  all_.add(path);
  classes_[path.path_class].add(path);
  for (const std::string& feature : path.classes) features_[feature].add(path);
}

std::vector<GradientFailure> GradientTable::failures() const {
  using Kind = GradientFailure::Kind;
  std::vector<GradientFailure> failures;
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary all = all_.summary(quantity);
    if (all.maximum <= tolerance(quantity)) continue;
    const auto found = std::find_if(classes_.begin(), classes_.end(), [&](const auto& entry) {
      const QuantitySummary s = entry.second.summary(quantity);
      return s.paths > 0 && s.worst == all.worst;
    });
    const std::string name = found != classes_.end() ? found->first : "";
    failures.push_back({Kind::Error, quantity, name, all.maximum, all.worst});
  }
  for (const Quantity quantity : kQuantities) {
    const QuantitySummary all = all_.summary(quantity);
    if (all.coordinates() == 0) continue;  // not asked for
    for (const auto& [name, record] : features_)
      if (record.paths() >= kSomePaths && record.compared_paths(quantity) == 0)
        failures.push_back({Kind::NotCompared, quantity, name, 0.0});
    if (all.coordinates() >= kManyCoordinates && all.set_aside() > kMostSetAside)
      failures.push_back({Kind::SetAside, quantity, "", all.set_aside()});
  }
  return failures;
}

}  // namespace driftlight
