// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "driftlight/path.h"

namespace driftlight {

/// What a small step never changes: at each vertex whether the lobe is delta and whether it passes
/// the surface, and how the path ends.
class LobeSequence {
 public:
  explicit LobeSequence(const PathTopology& path)
      : bits_(static_cast<std::uint64_t>(path.end) * (kMaxPathLength + 1) + path.light_count) {
    for (int k = 0; k < path.scatter_count; ++k) {
      const PathVertex& x = path.vertices[static_cast<std::size_t>(k)];
      const bool through = x.scattering == Scattering::Transmission;
      // No digit is 0, so that sequences of different lengths differ.
      bits_ = bits_ * 5 + 1 + (x.delta ? 2 : 0) + (through ? 1 : 0);
    }
  }

  bool operator==(const LobeSequence& other) const { return bits_ == other.bits_; }
  bool operator<(const LobeSequence& other) const { return bits_ < other.bits_; }

 private:
  std::uint64_t bits_;
};

}  // namespace driftlight
