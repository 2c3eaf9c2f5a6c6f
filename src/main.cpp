// SPDX-License-Identifier: Apache-2.0
/// The program: exit code 0 for success, 1 for a failure at run time, 2 for a mistake in the
/// command line or in the scene.
#include <fmt/format.h>

#include <cstdio>
#include <exception>

#include "cli/commands.h"

namespace {

int fail(const std::exception& error, int exit_code) {
  std::fputs(fmt::format("driftlight: error: {}\n", error.what()).c_str(), stderr);
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    std::visit([](const auto& command) { driftlight::cli::run(command); },
               driftlight::cli::parse_arguments(argc, argv));
    return 0;
  } catch (const driftlight::cli::UsageError& error) {
    const int exit_code = fail(error, 2);
    std::fputs("Run `driftlight --help` or `driftlight COMMAND --help`.\n", stderr);
    return exit_code;
  } catch (const driftlight::InputError& error) {
    return fail(error, 2);
  } catch (const std::exception& error) {
    return fail(error, 1);
  }
}
