// SPDX-License-Identifier: Apache-2.0
/// Runs a program the way a user would.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace driftlight::test {

/// A program that runs with its standard output and error in files, or with standard error on a
/// terminal. It is killed if it is still running at the end.
class Process {
 public:
  enum class Stderr { File, Terminal };

  /// Throws std::runtime_error if it cannot be started. Output goes to files in `scratch`.
  Process(const std::vector<std::string>& arguments, const std::filesystem::path& folder,
          const std::filesystem::path& scratch, Stderr stderr_to = Stderr::File);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void send(int signal) const;

  /// Waits until standard error, on a terminal, has shown `text`; false after the timeout.
  bool wait_for(const std::string& text, std::chrono::milliseconds timeout);

  /// Waits for the end. The exit code, or minus the signal that killed the program.
  int exit_code();

  /// After the end.
  std::string standard_output() const;
  std::string standard_error();

 private:
  void read_terminal(std::chrono::milliseconds timeout);

  std::filesystem::path output_;
  std::filesystem::path error_;
  pid_t pid_ = -1;
  int terminal_ = -1;  ///< our side of it
  std::string seen_;   ///< on the terminal
};

}  // namespace driftlight::test
