// SPDX-License-Identifier: Apache-2.0
/// Easier versions of a scene, for tempered splitting (DESIGN 1.10).
///
/// Level 0 is the scene itself, and each level k > 0 is softer than the one before: an environment
/// map is blurred with the standard deviation sigma_k, a geometric sequence from the size of its
/// sun up to kSoftest. Geometry, materials and indices are the same at all levels, so a path of one
/// level, with its topology and coordinates, is one of all; and its contribution is positive at
/// level k wherever it is at level k - 1.
#pragma once

#include <optional>
#include <vector>

#include "driftlight/scene.h"

namespace driftlight {

class TemperedScenes {
 public:
  /// So many softer levels; none: as many as halve sigma from one to the next, 0 if the scene has
  /// nothing sharp. The scene must outlive this.
  TemperedScenes(const Scene& scene, std::optional<int> levels);

  /// The softest level.
  int top() const { return static_cast<int>(softer_.size()); }
  const Scene& operator[](int level) const {
    return level == 0 ? *scene_ : softer_[static_cast<std::size_t>(level - 1)];
  }

 private:
  const Scene* scene_;
  std::vector<Scene> softer_;
};

}  // namespace driftlight
