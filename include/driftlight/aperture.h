// SPDX-License-Identifier: Apache-2.0
/// Apertures: the free width about the segments of a path ("passes through a small hole", the
/// potential barrier of [E63] section 3.1, which no gradient can see).
///
/// A segment of length l leaves x along v. A probe ray leaves x along v + s, the slope s across v;
/// the surface that the segment ends on, taken as a plane, would stop it at its reach. Where
/// something stops it notably earlier, a search over a ladder of slopes along one azimuth finds the
/// edge of what does, and the distance t along v at which it stands. Two opposite azimuths with
/// edges are a chord of the window; the middles of two chords across each other are near the
/// window's centre, and three chords through that, 60 degrees apart, tell its widths: the residual
///   r = kappa xi + omega,  kappa = 1 / t,
/// (xi, omega) the displacement of the segment across v, is free along e over the slopes s and s'
/// to both sides, a uniform distribution of precision 12 / (s + s')^2 = e.P e.
///
/// An edge on one side alone narrows nothing: half of all steps stay free of it, however long. Nor
/// do surfaces that end where the segment ends, as the walls of a corner do.
///
/// Off by default, as measured on small_hole and door_ajar: fewer proposals are blocked, but nearly
/// as many more fall to Hastings' rule, as Q now changes faster from place to place. Images are no
/// better at equal mutations, and a mutation costs 2 to 4 times as much.
#pragma once

#include <array>

#include "driftlight/linearization.h"

namespace driftlight {

/// Of one segment: the precision of r is P = row_0 row_0^T + row_1 row_1^T, across v.
struct Aperture {
  int segment = 0;   ///< 0 leaves the sensor
  double kappa = 0;  ///< 1 / distance from the start of the segment
  /// Per unit slope; the second is zero for a slit.
  std::array<Vec3d, 2> rows{Vec3d::Zero(), Vec3d::Zero()};
};

class Apertures {
 public:
  int count() const { return count_; }
  const Aperture& operator[](int i) const { return all_[static_cast<std::size_t>(i)]; }
  void add(const Aperture& aperture) { all_[static_cast<std::size_t>(count_++)] = aperture; }

 private:
  std::array<Aperture, kMaxPathLength> all_;
  int count_ = 0;
};

/// The apertures of a path that is lit, in order from the sensor. Free segments and the connection
/// to an emitter are probed; not those that a delta lobe determines, nor the first, whose window is
/// on the film, where the chains should move (it would halve their squared jumps there). A
/// deterministic function of its arguments, piecewise smooth: the ladder has 32 slopes from 1/2
/// down, 13 % apart. None for paths with a light side.
Apertures find_apertures(const Scene& scene, const PathTopology& topology,
                         const PathCoordinates& coordinates);

/// Adds the residual rows of the apertures to `path`, the constraints at the chart's base point.
/// Widths, distances and axes are those of the apertures, whatever the base point.
void constrain(const Scene& scene, const PathTopology& topology, const Chart& chart,
               const Apertures& apertures, Linearization& path);

}  // namespace driftlight
