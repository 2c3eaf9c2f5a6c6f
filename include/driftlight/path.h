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
/// Most blocks of coordinates: one for each edge, and a point on the lens.
inline constexpr int kMaxBlocks = kMaxPathLength + 1;
/// Bounds the coordinates of a path, two for each block: a multiple of 8, so that passes of Jets
/// fit in.
inline constexpr int kMaxDimension = (2 * kMaxBlocks + 7) / 8 * 8;

/// What the coordinates of paths are (DESIGN 1.2).
enum class PhaseSpace : std::uint8_t {
  Directions,     ///< directions from the sensor
  Bidirectional,  ///< from both ends, which one determined edge joins
};

/// How a path ends at an emitter (DESIGN 1.2); the last three are of paths with a light side.
enum class PathEnd : std::uint8_t {
  Hit,                    ///< the last direction hits an area emitter
  Environment,            ///< the last direction leaves the scene
  AreaConnection,         ///< determined edge to a point on an area emitter (two coordinates)
  PointConnection,        ///< determined edge to a point or spot emitter (no coordinates)
  DirectionalConnection,  ///< determined direction to a directional emitter (no coordinates)
  AreaEmission,           ///< from a point on an area emitter into a direction
  PointEmission,          ///< from a point or spot emitter into a direction
  DirectionalEmission,    ///< from a point on a disk across the light of a directional emitter
};

/// What the choice of coordinates knows of a vertex (chart_rule.h).
enum class Lobe : std::uint8_t {
  Delta,   ///< the next direction is determined: no edge may be joined here
  Narrow,  ///< some lobe is glossy
  Wide,    ///< diffuse: cares little about direction
};

/// A surface vertex x_1, x_2, .. of a path.
struct PathVertex {
  Hit hit;
  bool delta = false;  ///< the next direction is determined
  Scattering scattering = Scattering::Reflection;
};

/// The discrete choices of a path; for a fixed topology the contribution is a smooth function of
/// the coordinates. The first `scatter_count` vertices scatter; with PathEnd::Hit one more vertex
/// follows, on the emitter. The last `light_count` of them are the light side: their coordinates
/// are directions from the light, and the edge before them is determined by its two ends.
struct PathTopology {
  std::array<PathVertex, kMaxPathLength> vertices;
  std::uint32_t emitter = 0;
  PathEnd end = PathEnd::Hit;
  /// Whose rule has chosen these coordinates (chart_rule.h).
  PhaseSpace phase_space = PhaseSpace::Directions;
  std::uint8_t scatter_count = 0;
  std::uint8_t light_count = 0;
  std::uint8_t block_count = 0;
  bool has_lens = false;  ///< the first block is a point on the camera's lens

  /// Edges from the sensor to the emitter.
  int length() const { return scatter_count + 1; }
  /// Coordinates: two a block.
  int dimension() const { return 2 * block_count; }
  bool has_light_side() const { return light_count > 0; }
  /// Scattering vertices on the sensor's side.
  int camera_count() const { return scatter_count - light_count; }
  int lens_block_count() const { return has_lens ? 1 : 0; }
  /// Blocks on the sensor's side, before those of the light side: the point on the lens and free
  /// directions, but not that of the joining edge.
  int camera_block_count() const {
    if (!has_light_side()) return block_count;
    int count = lens_block_count() + (camera_count() > 0 ? 1 : 0);
    for (int k = 0; k + 1 < camera_count(); ++k)
      if (!vertices[static_cast<std::size_t>(k)].delta) ++count;
    return count;
  }
  /// The block that is a point on an emitter or on the disk of PathEnd::DirectionalEmission; -1 if
  /// there is none.
  int point_block() const {
    if (end == PathEnd::AreaConnection) return block_count - 1;
    if (end == PathEnd::AreaEmission || end == PathEnd::DirectionalEmission)
      return camera_block_count();
    return -1;
  }
  /// The path comes to its emitter by a determined edge or direction.
  bool ends_in_connection() const {
    return end == PathEnd::AreaConnection || end == PathEnd::PointConnection ||
           end == PathEnd::DirectionalConnection;
  }
  /// A point, spot or directional emitter: no ray can find it.
  bool ends_at_delta_emitter() const {
    return end != PathEnd::Hit && end != PathEnd::Environment && end != PathEnd::AreaConnection &&
           end != PathEnd::AreaEmission;
  }
};

/// The coordinates of a path, one block of two dimensions after the other: the unit directions v_k
/// that are free, in order from the sensor, v_0 the coordinate of the first ray (sensor.h); with
/// PathEnd::AreaConnection the last block is the position of the emitter point instead. Before them
/// all, of a camera with a lens, the point on it that the path begins at.
///
/// With a light side: the free directions on the sensor's side but that of the joining edge; then
/// those of the light side, all along the light:
///   PathEnd::AreaEmission         the point on the emitter and the emitted direction,
///   PathEnd::PointEmission        the emitted direction,
///   PathEnd::DirectionalEmission  the point where the ray crosses the disk of the scene's radius
///                                 across the light that touches the scene's sphere,
///   PathEnd::Environment          a point of the ray and its direction (of no chart: see walk.h),
/// and the free directions at its vertices, in order from the emitter, but that of the joining
/// edge.
struct PathCoordinates {
  std::array<Vec3d, kMaxBlocks> blocks;

  const Vec3d& operator()(int block) const { return blocks[static_cast<std::size_t>(block)]; }
  Vec3d& operator()(int block) { return blocks[static_cast<std::size_t>(block)]; }
};

}  // namespace driftlight
