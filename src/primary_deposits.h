// SPDX-License-Identifier: Apache-2.0
/// What chains in primary sample space leave on the film.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "driftlight/film.h"
#include "driftlight/random.h"
#include "primary_target.h"

namespace driftlight {

/// Light of a point.
struct PrimaryPlace {
  std::vector<PrimarySplat> splats;
  double target = 0;  ///< I
};

/// The light of a chain's point and of the one proposed. Both go to the film, over I, with weights
/// 1 - a and a, a the probability of acceptance.
class PrimaryDeposits {
 public:
  explicit PrimaryDeposits(Film& film) : film_(film) {}

  PrimaryPlace current;
  PrimaryPlace proposed;

  /// Accepts the proposal with that probability; then it is the current place.
  bool settle(double acceptance, Rng& rng) {
    gathered_ += 1.0 - acceptance;
    if (rng.uniform() < acceptance) {
      flush();
      std::swap(current, proposed);
      gathered_ = acceptance;
      return true;
    }
    if (acceptance > 0.0) splat(proposed, acceptance);
    return false;
  }

  /// Likewise where `proposed` is a path drawn out of a sample in proportion to its light: for what
  /// might have been drawn the whole sample takes the proposal's weight.
  bool settle(const PrimaryPlace& sample, double acceptance, Rng& rng) {
    if (acceptance > 0.0) splat(sample, acceptance);
    gathered_ += 1.0 - acceptance;
    if (!(rng.uniform() < acceptance)) return false;
    flush();
    std::swap(current, proposed);
    return true;
  }

  /// Deposits what the current place has gathered since it was entered.
  void flush() {
    if (gathered_ > 0.0) splat(current, gathered_);
    gathered_ = 0.0;
  }

 private:
  void splat(const PrimaryPlace& place, double weight) {
    for (const PrimarySplat& s : place.splats)
      film_.splat(s.film, s.color, weight * s.luminance / place.target);
  }

  Film& film_;
  double gathered_ = 0;
};

}  // namespace driftlight
