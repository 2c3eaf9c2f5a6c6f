// SPDX-License-Identifier: Apache-2.0
/// Primary sample space: the random numbers of a sample as coordinates.
#pragma once

#include <cstdint>
#include <vector>

#include "driftlight/options.h"
#include "driftlight/random.h"

namespace driftlight {

/// A small step of Kelemen et al. 2002:
///   +-s2 exp(-log(s2 / s1) xi),   s1 <= s2 the sizes of the options, xi uniform.
double small_step(const PrimaryOptions& options, Rng& rng);
/// The number u, moved by it modulo 1.
double moved(double u, const PrimaryOptions& options, Rng& rng);
/// Modulo 1, into (0, 1): numbers are never 0 and never 1.
double wrapped(double u);

/// A point of [0, 1)^infinity of which those coordinates exist that were asked for, with the
/// mutations of Kelemen et al. 2002. A small step moves each coordinate as above; a large one draws
/// all anew. Both are symmetric. A coordinate that was not asked for by some
/// mutations makes up for them when it is.
///
/// Delayed rejection: after a small step by d that is not accepted the point may move by a second,
/// smaller one e. Its ghost is moved by both, d + e.
class PrimarySample final : public UniformSource {
 public:
  /// A point drawn at random from this generator, which also drives its mutations.
  PrimarySample(const PrimaryOptions& options, Rng rng) : options_(options), rng_(rng) {}

  // Each from the first coordinate again, of a mutated point. What is not accepted is gone with the
  // next large or small step.
  void propose_large() { propose(Proposal::Large); }
  void propose_small() { propose(Proposal::Small); }
  /// By a second step, after a small one.
  void propose_second() { show(Proposal::Second); }
  /// After a second step.
  void show_ghost() { show(Proposal::Ghost); }
  /// Of a large or a small step.
  void accept();
  void accept_second();

  double next() override;

 private:
  enum class Proposal : std::uint8_t { None, Large, Small, Second, Ghost };
  /// What a mutation draws for a coordinate, if it has.
  struct Drawn {
    double value = 0;
    std::uint64_t mutation = 0;
  };
  struct Coordinate {
    double value = 0;
    std::uint64_t time = 0;  ///< of the accepted mutation that it has last followed
    Drawn first;             ///< the number of a large step, the step of a small one
    Drawn second;            ///< the second step
  };

  void propose(Proposal proposal);
  void show(Proposal proposal);
  /// Follows the mutations accepted so far.
  void follow(Coordinate& coordinate);
  double first_step(Coordinate& coordinate);
  double second_step(Coordinate& coordinate);

  const PrimaryOptions& options_;
  Rng rng_;
  std::vector<Coordinate> coordinates_;
  std::size_t next_ = 0;
  Proposal proposal_ = Proposal::None;
  std::uint64_t mutations_ = 0;        ///< proposed
  std::uint64_t time_ = 0;             ///< mutations accepted
  std::uint64_t last_large_time_ = 0;  ///< of the last large step that was accepted
};

}  // namespace driftlight
