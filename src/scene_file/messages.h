// SPDX-License-Identifier: Apache-2.0
/// What there is to say about a scene, collected while it is read.
#pragma once

#include <string>
#include <vector>

#include "driftlight/error.h"

namespace driftlight {

/// Notices and errors, in the order in which they were found; the same is said once.
class Messages {
 public:
  /// If strict, what is not used is an error.
  explicit Messages(bool strict) : strict_(strict) {}

  /// Of very many notices only the first are kept.
  void notice(const SourceLocation& place, const std::string& message);

  /// Something that nobody uses, such as a misspelt property. The excerpt is for the error.
  void unused(const SourceLocation& place, const std::string& message, const std::string& excerpt);

  /// Keeps an error, after which the rest of the file is still looked at. Of very many only the
  /// first are kept.
  void error(const SceneError& error);

  bool has_errors() const { return !errors_.empty(); }
  /// True if there is no point in looking for more errors.
  bool is_full() const;
  /// Throws the errors, if there are any, as one: each as it is, one below the other, then what is
  /// not used, which may be why.
  void throw_errors() const;

  const std::vector<std::string>& notices() const { return notices_; }

 private:
  bool strict_;
  std::vector<std::string> notices_;
  std::vector<std::string> unused_;  ///< those of the notices that are about something unused
  std::vector<SceneError> errors_;
};

}  // namespace driftlight
