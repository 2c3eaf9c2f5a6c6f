// SPDX-License-Identifier: Apache-2.0
#include "messages.h"

#include <algorithm>
#include <string_view>

namespace driftlight {
namespace {

constexpr std::size_t kMaximumNotices = 200;
constexpr std::size_t kMaximumErrors = 50;

}  // namespace

void Messages::notice(const SourceLocation& place, const std::string& message) {
  const std::string text = to_string(place) + ": " + message;
  if (std::find(notices_.begin(), notices_.end(), text) != notices_.end()) return;
  if (notices_.size() < kMaximumNotices)
    notices_.push_back(text);
  else if (notices_.size() == kMaximumNotices)
    notices_.emplace_back("further notices are left out");
}

void Messages::unused(const SourceLocation& place, const std::string& message,
                      const std::string& excerpt) {
  if (strict_) {
    error(SceneError(place, message + excerpt));
    return;
  }
  const std::size_t before = notices_.size();
  notice(place, message);
  if (notices_.size() > before) unused_.push_back(notices_.back());
}

void Messages::error(const SceneError& error) {
  const std::string_view text = error.what();
  if (is_full()) return;
  if (std::any_of(errors_.begin(), errors_.end(),
                  [&](const SceneError& other) { return text == other.what(); }))
    return;
  errors_.push_back(error);
}

bool Messages::is_full() const { return errors_.size() >= kMaximumErrors; }

void Messages::throw_errors() const {
  if (errors_.empty()) return;
  const SceneError& first = errors_.front();
  std::string text = std::string(first.what()).substr((to_string(first.location()) + ": ").size());
  for (std::size_t i = 1; i < errors_.size(); ++i) text += std::string("\n") + errors_[i].what();
  if (errors_.size() > 1)
    text += "\n" + std::to_string(errors_.size()) +
            (is_full() ? " errors; what comes after them is not read" : " errors");
  if (!unused_.empty()) text += "\nbesides:";
  for (const std::string& unused : unused_) text += "\n" + unused;
  throw SceneError(first.location(), text);
}

}  // namespace driftlight
