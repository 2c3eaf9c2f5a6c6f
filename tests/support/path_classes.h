// SPDX-License-Identifier: Apache-2.0
/// The classes of paths that tests must see, so that they can assert that they saw everything.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "driftlight/path_sampler.h"
#include "driftlight/scene.h"

namespace driftlight::test {

/// The classes of a sampled path (path_class.h).
std::set<std::string> classes_of(const Scene& scene, const PathSampler::Sample& path);

/// Every class that the test scenes must produce between them.
const std::vector<std::string>& required_classes();

/// Counts classes; `missing` lists those of required_classes that are rarer than `minimum`.
class ClassCounter {
 public:
  void add(const std::set<std::string>& classes);
  std::vector<std::string> missing(int minimum) const;

 private:
  std::map<std::string, int> counts_;
};

}  // namespace driftlight::test
