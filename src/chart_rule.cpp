// SPDX-License-Identifier: Apache-2.0
#include "driftlight/chart_rule.h"

#include <cstdlib>

#include "driftlight/phase_space.h"

namespace driftlight {
namespace {

/// The lobes at both ends of edge t, from x_(t-1) to x_t, with the sensor and the emitter wide.
class Edges {
 public:
  explicit Edges(std::span<const Lobe> lobes) : lobes_(lobes) {}

  int count() const { return static_cast<int>(lobes_.size()) + 1; }

  /// The edge nearest to the middle whose ends are at least `least`; 0 if there is none.
  int nearest_to_middle(Lobe least) const {
    int best = 0;
    for (int t = 1; t <= count(); ++t)
      if (lobe(t - 1) >= least && lobe(t) >= least &&
          (best == 0 || from_middle(t) <= from_middle(best)))
        best = t;
    return best;
  }

 private:
  Lobe lobe(int vertex) const {
    if (vertex == 0 || vertex == count()) return Lobe::Wide;
    return lobes_[static_cast<std::size_t>(vertex - 1)];
  }
  int from_middle(int t) const { return std::abs(2 * t - (count() + 1)); }

  std::span<const Lobe> lobes_;
};

/// A finite emitter whose points have no coordinates, or an environment.
bool has_no_light_side(const Scene& scene, const Emitter& emitter) {
  const AreaEmitter* area = area_of(emitter);
  return is_environment(emitter) || (area != nullptr && !has_points(scene.shapes()[area->shape]));
}

}  // namespace

Lobe lobe_of(const Bsdf& bsdf, bool delta) {
  if (delta) return Lobe::Delta;
  return is_diffuse(bsdf) ? Lobe::Wide : Lobe::Narrow;
}

std::optional<int> light_side(PhaseSpace phase_space, const Scene& scene,
                              std::span<const Lobe> lobes, std::uint32_t index) {
  const Emitter& emitter = scene.emitters()[index];
  const bool can_be_hit = is_environment(emitter) || area_of(emitter) != nullptr;
  if (lobes.empty() && !can_be_hit) return std::nullopt;
  const bool has_directions = can_be_hit || lobes.back() != Lobe::Delta;
  const bool ends_wide = lobes.empty() || lobes.back() == Lobe::Wide;
  if (phase_space == PhaseSpace::Bidirectional && !ends_wide &&
      !has_no_light_side(scene, emitter)) {
    const Edges edges(lobes);
    int edge = edges.nearest_to_middle(Lobe::Wide);
    if (edge == 0 && !has_directions) edge = edges.nearest_to_middle(Lobe::Narrow);
    if (edge > 0) return edges.count() - edge;
  }
  return has_directions ? std::optional(0) : std::nullopt;
}

}  // namespace driftlight
