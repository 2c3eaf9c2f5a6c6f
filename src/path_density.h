// SPDX-License-Identifier: Apache-2.0
/// Densities with which the strategies of path_sampler.h make a given path.
///
/// A path x_0 .. x_n, its camera part x_0 .. x_{t-1} and its light part x_t .. x_n, s = n + 1 - t.
/// The measure is that of camera-side solid angles, d omega_k of the free directions v_k.
///
/// - The camera part: C_0 = W(v_0), then C_k = p(v_k | v_{k-1}), or the probability of a delta
/// lobe.
/// - The light part makes x_n per area, then each x_a per area from the next non-delta vertex x_b
/// on
///   its light side, by a direction omega_b of density l_b through the delta lobes between, taken
///   with probabilities P. In camera-side measure each area dA_b becomes d omega_a. Along a smooth
///   chain n^2 cos d omega dA is conserved (etendue), so
///     p(dA_a | x_b) dA_b / d omega_a = l_b prod P (n_a^2 cos_a) / (n_b^2 cos_b),
///   cos_a that of v_a at x_a, cos_b that of the arriving edge at x_b (both geometric), n the
///   refractive index at the ends of the chain. A delta lobe keeps n^2 |n_s.w| d omega about its
///   shading normal, while areas go by |n_g.w|: where the two normals differ each such vertex adds
///   |n_s.w_i| |n_g.w_o| / (|n_s.w_o| |n_g.w_i|).
/// - The connection joins two non-delta vertices: dA_t / d omega_{t-1} = r^2 / cos_t.
/// Ends: an area emitter has p(x_n) = 1 / area and l_n = cos_n / pi; an environment is drawn by
/// direction, p(omega), and by the point where the ray crosses a disk of the scene's radius R,
/// which gives p(omega) / (pi R^2) in place of l_n / cos_n; a point or spot emitter has no area to
/// convert, p(dA_a | x_n) = l_n cos_a / r^2 with l_n = 1 / (4 pi) or falloff / (its integral); a
/// directional emitter has its one direction, p(dA_a) = cos_a / (pi R^2). A guide
/// multiplies l_n.
#pragma once

#include <array>

#include "driftlight/phase_space.h"
#include "emission_guide.h"

namespace driftlight {

/// q_s of one path for every s = 0 .. n; 0 where a strategy cannot make it.
struct StrategyDensities {
  std::array<double, kMaxPathLength + 1> by_light_vertices{};
};

/// In the measure of the path's coordinates: with an emitter point among them (AreaConnection),
/// d omega of the last direction becomes dA. With a light side the factors above turn camera-side
/// solid angles into dA d omega of the emitter, as in contribution.h; a point emitter has its d
/// omega in the place of dA of the first vertex behind it. There a delta vertex is no obstacle:
/// what the chain behind the point makes of d omega is the same for all strategies.
/// Light subpaths are those of the guide.
StrategyDensities strategy_densities(const Scene& scene, const EmissionGuide& guide,
                                     const PathTopology& topology,
                                     const PathCoordinates& coordinates);

}  // namespace driftlight
