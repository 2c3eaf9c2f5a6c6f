// SPDX-License-Identifier: Apache-2.0
/// Light paths: the discrete choices (topology) apart from the continuous coordinates.
#pragma once

#include <array>
#include <cstdint>

#include "driftlight/bsdf.h"
#include "driftlight/emitter.h"
#include "driftlight/geometry.h"

namespace driftlight {

/// Longest path, in edges. Bounds all per-path storage, so that nothing allocates.
inline constexpr int kMaxPathLength = 16;
/// Most coordinates of a path: two for each free direction or emitter point.
inline constexpr int kMaxDimension = 2 * kMaxPathLength;

/// How a path ends at an emitter (DESIGN 1.2).
enum class PathEnd : std::uint8_t {
  Hit,              ///< the last direction hits an area emitter
  Environment,      ///< the last direction leaves the scene
  AreaConnection,   ///< deterministic edge to a point on an area emitter (two coordinates)
  PointConnection,  ///< deterministic edge to a point emitter (no coordinates)
};

/// A surface vertex x_1, x_2, .. of a path.
struct PathVertex {
  Hit hit;
  bool delta = false;  ///< the next direction is determined
  Scattering scattering = Scattering::Reflection;
};

/// The discrete choices of a path; for a fixed topology the contribution is a smooth function of
/// the coordinates. The first `scatter_count` vertices scatter; with PathEnd::Hit one more vertex
/// follows, on the emitter.
struct PathTopology {
  std::array<PathVertex, kMaxPathLength> vertices;
  std::uint32_t emitter = 0;
  PathEnd end = PathEnd::Hit;
  std::uint8_t scatter_count = 0;
  std::uint8_t block_count = 0;

  /// Edges from the sensor to the emitter.
  int length() const { return scatter_count + 1; }
  /// Coordinates: two a block.
  int dimension() const { return 2 * block_count; }
  bool ends_in_connection() const {
    return end == PathEnd::AreaConnection || end == PathEnd::PointConnection;
  }
};

/// The coordinates of a path, one block of two dimensions after the other: the unit directions v_k
/// that are free, in order from the sensor; with PathEnd::AreaConnection the last block is the
/// position of the emitter point instead.
struct PathCoordinates {
  std::array<Vec3d, kMaxPathLength> blocks;

  const Vec3d& operator()(int block) const { return blocks[static_cast<std::size_t>(block)]; }
  Vec3d& operator()(int block) { return blocks[static_cast<std::size_t>(block)]; }
};

}  // namespace driftlight
