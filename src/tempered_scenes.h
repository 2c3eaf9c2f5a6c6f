// SPDX-License-Identifier: Apache-2.0
/// Easier versions of a scene, for tempered splitting (DESIGN 1.10).
///
/// Level 0 is the scene itself, and each level k > 0 is softer than the one before: an environment
/// map is blurred with the standard deviation sigma_k, a geometric sequence from the size of its
/// sun up to wide, small area emitters likewise (BlurredAreaEmitter), and narrow lobes of rough
/// BSDFs have at least a roughness that grows in the same way. Shapes, lobes and indices are the
/// same at all levels, so a path of one level, with its topology and coordinates, is one of all;
/// and its contribution is positive at level k wherever it is at level k - 1. Two things are not
/// alike. Where a blurred lamp ends a path there is no vertex: at level 0 its last hit is to be
/// traced. And only rays see it that leave a surface: lamps that the sensor sees directly, and
/// paths in whose chart a point on an area emitter is among the coordinates, are left to level 0.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "driftlight/path.h"
#include "driftlight/scene.h"

namespace driftlight {

class TemperedScenes {
 public:
  /// So many softer levels, with all area emitters blurred; none: as many as halve what is sharp
  /// from one to the next, twice as many for lobes, 0 if nothing is, and area emitters are blurred
  /// only if one is small. The scene must outlive this.
  TemperedScenes(const Scene& scene, std::optional<int> levels);

  /// The softest level.
  int top() const { return static_cast<int>(softer_.size()); }
  const Scene& operator[](int level) const {
    return level == 0 ? *scene_ : *softer_[static_cast<std::size_t>(level - 1)];
  }
  /// Whether narrow lobes are rougher at the softer levels.
  bool soften_lobes() const { return softens_lobes_; }
  /// Leaves out a level between the scene and the softest one. The others' scenes stay where they
  /// are.
  void leave_out(int level) { softer_.erase(softer_.begin() + (level - 1)); }
  /// A path of a softer level, as it is at level 0; none if it does not reach its emitter there.
  std::optional<PathTopology> at_level_0(const PathTopology& path,
                                         const PathCoordinates& coordinates) const;
  /// Whether a path of level 0 is one of all levels.
  bool carry(const PathTopology& path) const {
    if (!blurs_lamps_) return true;
    const bool seen_directly = path.end == PathEnd::Hit && path.scatter_count == 0;
    return !seen_directly && path.end != PathEnd::AreaConnection &&
           path.end != PathEnd::AreaEmission;
  }

 private:
  const Scene* scene_;
  std::vector<std::unique_ptr<const Scene>> softer_;
  bool blurs_lamps_ = false;
  bool softens_lobes_ = false;
};

}  // namespace driftlight
