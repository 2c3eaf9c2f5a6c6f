// SPDX-License-Identifier: Apache-2.0
#include "substitutions.h"

#include <fmt/format.h>

#include "nearest_names.h"

namespace driftlight {
namespace {

/// A <default> may use others, so that a few lines could ask for more than memory holds.
constexpr std::size_t kMaximumLength = std::size_t{1} << 16U;

/// The identifier that the text begins with, for messages.
std::string_view leading_identifier(std::string_view text) {
  const auto is_identifier = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  std::size_t length = 0;
  while (length < text.size() && is_identifier(text[length])) ++length;
  return text.substr(0, length);
}

std::vector<std::string> keys(const std::map<std::string, std::string>& values) {
  std::vector<std::string> names;
  names.reserve(values.size());
  for (const auto& [name, value] : values) names.push_back(name);
  return names;
}

}  // namespace

Substitutions::Substitutions(std::map<std::string, std::string> defines)
    : values_(std::move(defines)) {
  for (const auto& [name, value] : values_) unused_defines_.insert(name);
}

void Substitutions::add_default(const std::string& name, const std::string& value) {
  values_.try_emplace(name, value);
  declared_.insert(name);
  unused_defines_.erase(name);
}

const std::string* Substitutions::longest_name(std::string_view text) const {
  const std::string* best = nullptr;
  for (const auto& [name, value] : values_) {
    const bool fits = !name.empty() && text.substr(0, name.size()) == name;
    if (fits && (!best || name.size() > best->size())) best = &name;
  }
  return best;
}

std::string Substitutions::apply(const std::string& text, Dialect dialect) {
  const bool keeps_names = dialect == Dialect::Mitsuba06 && text.find('[') != std::string::npos;
  std::string result;
  std::size_t done = 0;
  std::size_t next = 0;
  for (auto dollar = text.find('$'); dollar != std::string::npos; dollar = text.find('$', next)) {
    const std::string_view rest = std::string_view(text).substr(dollar + 1);
    const std::string* const name = longest_name(rest);
    next = dollar + 1;
    if (!name && keeps_names) continue;
    if (!name)
      throw InputError("'$" + std::string(leading_identifier(rest)) +
                       "' has no value; give it one with <default> or on the command line; " +
                       hint(leading_identifier(rest), keys(values_)));
    result.append(text, done, dollar - done).append(values_.at(*name));
    unused_defines_.erase(*name);
    declared_.insert(*name);
    next = done = dollar + 1 + name->size();
    if (result.size() > kMaximumLength)
      throw InputError("with its $names replaced, the text is longer than " +
                       std::to_string(kMaximumLength) + " characters");
  }
  return result.append(text, done);
}

void Substitutions::check_defines_used(const std::filesystem::path& file) const {
  std::string message;
  for (const std::string& name : unused_defines_)
    message += fmt::format("{}the definition of '{}' is not used: the scene has no ${}; {}",
                           message.empty() ? "" : "; ", name, name,
                           hint(name, {declared_.begin(), declared_.end()}));
  if (!message.empty()) throw SceneError({file.string()}, message);
}

}  // namespace driftlight
