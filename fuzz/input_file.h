// SPDX-License-Identifier: Apache-2.0
/// The bytes of a fuzzer as a file.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

namespace driftlight::fuzz {

/// Writes the bytes into a file of this process, the same each time. Returns its path.
inline std::filesystem::path input_file(const std::string& name, const std::uint8_t* data,
                                        std::size_t size) {
  static const std::filesystem::path kDirectory =
      std::filesystem::temp_directory_path() / ("driftlight_fuzz_" + std::to_string(::getpid()));
  std::filesystem::create_directories(kDirectory);
  const std::filesystem::path file = kDirectory / name;
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  return file;
}

}  // namespace driftlight::fuzz
