// SPDX-License-Identifier: Apache-2.0
#include "support/process.h"

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace driftlight::test {

namespace {

std::string read_text(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

int open_for_writing(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (descriptor < 0) throw std::runtime_error("cannot open " + file.string());
  return descriptor;
}

/// In the child: never returns.
[[noreturn]] void become(const std::filesystem::path& folder, int output, int error,
                         char* const* arguments) {
  if (::chdir(folder.c_str()) == 0 && ::dup2(output, STDOUT_FILENO) >= 0 &&
      ::dup2(error, STDERR_FILENO) >= 0)
    ::execv(arguments[0], arguments);
  ::_exit(127);
}

}  // namespace

Process::Process(const std::vector<std::string>& arguments, const std::filesystem::path& folder,
                 const std::filesystem::path& scratch, Stderr stderr_to)
    : output_(scratch / "stdout"), error_(scratch / "stderr") {
  std::vector<std::string> copies = arguments;
  std::vector<char*> pointers;
  for (std::string& argument : copies) pointers.push_back(argument.data());
  pointers.push_back(nullptr);

  const int output = open_for_writing(output_);
  int error = -1;
  if (stderr_to == Stderr::File)
    error = open_for_writing(error_);
  else if (::openpty(&terminal_, &error, nullptr, nullptr, nullptr) != 0)
    throw std::runtime_error("cannot open a terminal");
  pid_ = ::fork();
  if (pid_ == 0) become(folder, output, error, pointers.data());
  ::close(output);
  ::close(error);
  if (pid_ < 0) throw std::runtime_error("cannot start " + arguments.front());
}

Process::~Process() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    exit_code();
  }
  if (terminal_ >= 0) ::close(terminal_);
}

void Process::send(int signal) const { ::kill(pid_, signal); }

void Process::read_terminal(std::chrono::milliseconds timeout) {
  pollfd poller{.fd = terminal_, .events = POLLIN, .revents = 0};
  if (::poll(&poller, 1, static_cast<int>(timeout.count())) <= 0) return;
  char buffer[4096];
  const ssize_t count = ::read(terminal_, buffer, sizeof buffer);
  if (count > 0) seen_.append(buffer, static_cast<std::size_t>(count));
}

bool Process::wait_for(const std::string& text, std::chrono::milliseconds timeout) {
  const auto end = std::chrono::steady_clock::now() + timeout;
  while (seen_.find(text) == std::string::npos) {
    if (std::chrono::steady_clock::now() > end) return false;
    read_terminal(std::chrono::milliseconds(50));
  }
  return true;
}

int Process::exit_code() {
  int status = 0;
  // A full terminal would block the program: keep reading.
  while (terminal_ >= 0 && ::waitpid(pid_, &status, WNOHANG) == 0)
    read_terminal(std::chrono::milliseconds(20));
  if (terminal_ < 0) ::waitpid(pid_, &status, 0);
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

std::string Process::standard_output() const { return read_text(output_); }

std::string Process::standard_error() {
  if (terminal_ < 0) return read_text(error_);
  read_terminal(std::chrono::milliseconds(0));
  return seen_;
}

}  // namespace driftlight::test
