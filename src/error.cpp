// SPDX-License-Identifier: Apache-2.0
#include "driftlight/error.h"

#include <fmt/format.h>

#include <utility>

namespace driftlight {

std::string to_string(const SourceLocation& location) {
  std::string text = location.file;
  if (location.line > 0) text += fmt::format(":{}", location.line);
  if (location.line > 0 && location.column > 0) text += fmt::format(":{}", location.column);
  return text;
}

SceneError::SceneError(SourceLocation location, const std::string& message)
    : InputError(to_string(location) + ": " + message), location_(std::move(location)) {}

}  // namespace driftlight
