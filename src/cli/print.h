// SPDX-License-Identifier: Apache-2.0
/// Output of the program.
#pragma once

#include <cstdio>
#include <string>

namespace driftlight::cli {

/// Prints a result to standard output.
inline void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

/// Prints a remark to standard error, as a line of its own.
inline void print_notice(const std::string& text) {
  std::fputs(("driftlight: " + text + "\n").c_str(), stderr);
}

}  // namespace driftlight::cli
