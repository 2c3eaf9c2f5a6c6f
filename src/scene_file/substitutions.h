// SPDX-License-Identifier: Apache-2.0
/// The $names of scene files.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>

#include "dialect.h"
#include "driftlight/error.h"

namespace driftlight {

/// Values for $name. Those given by the user win over the <default>s of the file. A value is plain
/// text: a $ in it is not substituted again.
class Substitutions {
 public:
  explicit Substitutions(std::map<std::string, std::string> defines);

  /// Takes note of <default name="..." value="...">.
  void add_default(const std::string& name, const std::string& value);

  /// The text with every $name replaced by the value of the longest name that fits there, as
  /// Mitsuba does. Throws InputError on a name without a value, or if the text grows too long. In
  /// the older dialect a text with a '[' may be an annotation of a film, which has names of its
  /// own: there those without a value stay.
  std::string apply(const std::string& text, Dialect dialect);

  /// Throws SceneError naming all that the user defined and that `file` neither uses nor declares.
  void check_defines_used(const std::filesystem::path& file) const;

 private:
  const std::string* longest_name(std::string_view text) const;

  std::map<std::string, std::string> values_;
  std::set<std::string> unused_defines_;
  std::set<std::string> declared_;  ///< names that the scene uses or has a <default> for
};

}  // namespace driftlight
