// SPDX-License-Identifier: Apache-2.0
#include "dialect.h"

namespace driftlight {

std::optional<Dialect> dialect_of(std::string_view version) {
  if (version.starts_with("0.5.") || version.starts_with("0.6.")) return Dialect::Mitsuba06;
  if (version.starts_with("2.") || version.starts_with("3.")) return Dialect::Mitsuba3;
  return std::nullopt;
}

bool has_backward_spectra(std::string_view version) { return version.starts_with("0.5."); }

std::string snake_case(std::string_view name) {
  const auto is_capital = [](char c) { return c >= 'A' && c <= 'Z'; };
  std::string result;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool starts_word = is_capital(name[i]) && i > 0 && !is_capital(name[i - 1]);
    if (starts_word && name[i - 1] != '_') result += '_';
    result += is_capital(name[i]) ? static_cast<char>(name[i] - 'A' + 'a') : name[i];
  }
  return result;
}

std::string spelling(std::string_view name, Dialect dialect) {
  return dialect == Dialect::Mitsuba3 ? snake_case(name) : std::string(name);
}

}  // namespace driftlight
