// SPDX-License-Identifier: Apache-2.0
/// What a PLY file says about itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace driftlight {

enum class PlyEncoding { Ascii, LittleEndian, BigEndian };

enum class PlyType { Int8, UInt8, Int16, UInt16, Int32, UInt32, Float32, Float64 };

/// In bytes.
std::size_t size_of(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::Float32;    ///< of the value, or of each value of a list
  std::optional<PlyType> count_type;  ///< of the number of values; only of lists
};

/// `count` rows, each with a value or list for every property.
struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::Ascii;
  std::vector<PlyElement> elements;
  std::size_t size = 0;  ///< bytes, with the end of its last line
};

/// The header at the beginning of `bytes`. Throws LineError if a line is wrong, else InputError.
PlyHeader read_ply_header(std::string_view bytes);

}  // namespace driftlight
