// SPDX-License-Identifier: Apache-2.0
/// Where light that reaches the film is emitted, and how often it pays to look: a density over
/// emitted rays, learned from what a pilot has found.
///
/// Light subpaths are drawn with the density of emission, times a factor that is piecewise constant
/// over the primary samples of emission.h (Guo et al. 2018, "Primary sample space path guiding";
/// the tree and its rounds of learning as in Mueller et al. 2017, "Practical path guiding"). An
/// opening, or a glass in a wide landscape, then gets most of the subpaths. All densities remain
/// exact.
///
/// Where the sensor's side finds all that matters, only a sample now and then has a light subpath.
/// Densities are those of a sample: over all rays they integrate to the rate, which is then a
/// factor of the density of each strategy with a light subpath (s > 1), and of no other. Weights of
/// strategies and contributions over densities need to know nothing else of it (the number of
/// samples n_i in Veach 1997, 9.2).
#pragma once

#include <optional>
#include <vector>

#include "density_tree.h"
#include "emission.h"

namespace driftlight {

class EmissionGuide {
 public:
  /// No guidance: rays as the emitters emit them.
  explicit EmissionGuide(const Scene& scene);

  /// A light subpath of the pilot: its first ray, and what its sample found by way of it.
  struct Record {
    std::uint32_t emitter;
    EmissionSample sample;
    double value;   ///< luminance over the brightness around
    double factor;  ///< with which the ray was drawn
  };
  /// With no record of light it guides nothing.
  EmissionGuide(const Scene& scene, const std::vector<Record>& records);
  /// The same for so many light subpaths a sample, in the mean, in (0, 1].
  EmissionGuide at_rate(double rate) const;

  double rate() const { return rate_; }
  /// The first ray of a light subpath.
  Emission sample(Rng& rng) const;
  /// Of the ray along v through p, as of emission_sample: its density over that of emission.
  double factor(std::uint32_t emitter, const Vec3d& p, const Vec3d& v) const;
  /// Density of the ray from the end along v through p, beyond end.density.
  double density(const LightEnd& end, const Vec3d& p, const Vec3d& v, double cosine,
                 double falloff) const {
    return emission_density(*scene_, end, cosine, falloff) * factor(end.emitter, p, v);
  }
  double density(const Emission& ray) const {
    return density(ray.end, ray.origin, ray.direction, ray.cosine, ray.falloff);
  }

 private:
  /// What was learned of an emitter.
  struct Learned {
    DensityTree tree;
    double choice;  ///< its probability over that of emitter sampling
  };

  const Scene* scene_;
  std::vector<Learned> emitters_;  ///< none: no guidance
  std::optional<DiscreteDistribution> choice_;
  double rate_ = 1;
};

}  // namespace driftlight
