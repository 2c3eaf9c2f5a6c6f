// SPDX-License-Identifier: Apache-2.0
/// Primary sample space: the random numbers of a sample as coordinates.
#pragma once

#include <cstdint>
#include <vector>

#include "driftlight/options.h"
#include "driftlight/random.h"

namespace driftlight {

/// The number u, moved by a small step of Kelemen et al. 2002:
///   +-s2 exp(-log(s2 / s1) xi),   s1 <= s2 the sizes of the options, xi uniform, modulo 1.
double moved(double u, const PrimaryOptions& options, Rng& rng);
/// Modulo 1, into (0, 1): numbers are never 0 and never 1.
double wrapped(double u);

/// A point of [0, 1)^infinity of which those coordinates exist that were asked for, with the
/// mutations of Kelemen et al. 2002. A small step moves each coordinate as above; a large one draws
/// all anew. Both are symmetric. A coordinate that was not asked for by some
/// mutations makes up for them when it is.
class PrimarySample final : public UniformSource {
 public:
  /// A point drawn at random from this generator, which also drives its mutations.
  PrimarySample(const PrimaryOptions& options, Rng rng) : options_(options), rng_(rng) {}

  /// From the first coordinate again, of a mutated point. Until it is accepted or rejected there
  /// must be no other.
  void propose_large() { propose(true); }
  void propose_small() { propose(false); }
  void accept();
  void reject();

  double next() override;

 private:
  struct Coordinate {
    double value = 0;
    std::uint64_t time = 0;  ///< of the mutation that it has last followed
    double old_value = 0;
    std::uint64_t old_time = 0;
  };

  void propose(bool large);

  const PrimaryOptions& options_;
  Rng rng_;
  std::vector<Coordinate> coordinates_;
  std::size_t next_ = 0;
  std::uint64_t time_ = 0;             ///< mutations accepted so far, and that under way
  std::uint64_t last_large_time_ = 0;  ///< of the last large step that was accepted
  bool large_ = false;                 ///< the one under way
};

}  // namespace driftlight
