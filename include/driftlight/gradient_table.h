// SPDX-License-Identifier: Apache-2.0
/// What the checks of many paths found, by class of path.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "driftlight/gradient_check.h"

namespace driftlight {

/// A path that was checked, as the table wants it.
struct CheckedPath {
  std::uint64_t index = 0;        ///< by which it can be drawn again
  std::string path_class;         ///< path_class() of it
  std::set<std::string> classes;  ///< classes_of() it
  std::array<Comparison, kQuantityCount> results;
};

/// One quantity over the paths of a class.
struct QuantitySummary {
  std::uint64_t paths = 0;     ///< on which something was compared
  std::uint64_t compared = 0;  ///< coordinates
  std::uint64_t kinks = 0;
  std::uint64_t undecided = 0;
  double median = 0;  ///< of the relative errors of the paths
  double maximum = 0;
  std::uint64_t worst = 0;  ///< index of the path with the maximum

  std::uint64_t coordinates() const { return compared + kinks + undecided; }
  /// Part of the coordinates that was not compared.
  double set_aside() const;
};

class ClassRecord {
 public:
  void add(const CheckedPath& path);

  std::uint64_t paths() const { return paths_; }
  /// Those on which something of the quantity was compared.
  std::uint64_t compared_paths(Quantity quantity) const {
    return records_[static_cast<std::size_t>(quantity)].errors.size();
  }
  QuantitySummary summary(Quantity quantity) const;
  /// Index of the path whose error is the largest part of its tolerance.
  std::uint64_t worst() const;

 private:
  struct Entry {
    double error;
    std::uint64_t index;
  };
  struct Record {
    std::vector<Entry> errors;
    std::uint64_t compared = 0;
    std::uint64_t kinks = 0;
    std::uint64_t undecided = 0;
  };

  std::array<Record, kQuantityCount> records_;
  std::uint64_t paths_ = 0;
};

/// Alphabetical, numbers by their value.
struct ByNameAndNumber {
  bool operator()(const std::string& a, const std::string& b) const;
};
using ClassRecords = std::map<std::string, ClassRecord, ByNameAndNumber>;

/// Why a table does not pass.
struct GradientFailure {
  enum class Kind : std::uint8_t {
    Error,        ///< above tolerance
    NotCompared,  ///< all paths of a class were set aside; it has five at least
    SetAside,     ///< more than a fiftieth of all coordinates, a thousand at least
  };

  Kind kind;
  Quantity quantity;
  std::string path_class;   ///< Error: of the path; NotCompared: the class
  double value;             ///< Error: relative; SetAside: the part
  std::uint64_t index = 0;  ///< Error: of the path
};

class GradientTable {
 public:
  void add(const CheckedPath& path);

  const ClassRecord& all() const { return all_; }
  /// By single feature: length, lobe, surface, end.
  const ClassRecords& features() const { return features_; }
  /// By path_class().
  const ClassRecords& classes() const { return classes_; }
  /// Empty if the derivatives are right. The worst error of each quantity, then the others.
  std::vector<GradientFailure> failures() const;

 private:
  ClassRecord all_;
  ClassRecords features_;
  ClassRecords classes_;
};

}  // namespace driftlight
