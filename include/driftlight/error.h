// SPDX-License-Identifier: Apache-2.0
/// Errors that a user can mend.
#pragma once

#include <stdexcept>
#include <string>

namespace driftlight {

/// Base of all errors of input: one clear message, ready to print. Programs end with exit code 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Where in a text file something was found; line and column count from 1, 0 means unknown.
struct SourceLocation {
  std::string file;
  int line = 0;
  int column = 0;
};

/// "file:line:column", without the parts that are unknown.
std::string to_string(const SourceLocation& location);

/// A scene that cannot be rendered as written. The message starts with "file:line:column: ".
class SceneError : public InputError {
 public:
  SceneError(SourceLocation location, const std::string& message);
  const SourceLocation& location() const { return location_; }

 private:
  SourceLocation location_;
};

/// An option with an impossible value; names the option, the value and the bound.
class OptionError : public InputError {
 public:
  using InputError::InputError;
};

/// A failure at run time that is nobody's input (a full disk, say). Exit code 1.
class RuntimeError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace driftlight
