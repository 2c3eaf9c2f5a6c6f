// SPDX-License-Identifier: Apache-2.0
/// Means of independent numbers, and Student's test of them.
#pragma once

#include <cstdint>

namespace driftlight {

/// Mean and variance of independent numbers, by Welford's recurrence.
class Moments {
 public:
  void add(double x);

  std::uint64_t count() const { return count_; }
  double mean() const { return mean_; }
  /// Unbiased variance of one number.
  double variance() const;
  /// Standard error of the mean.
  double error() const;

 private:
  std::uint64_t count_ = 0;
  double mean_ = 0;
  double squares_ = 0;
};

/// Two-sided p-value of a deviate t of Student's distribution; 0 if t is not finite.
double student_two_sided(double t, double degrees);

/// Two-sided p-value of Student's test that the mean is `expected`.
double student_p_value(const Moments& sample, double expected);

/// Half the width of the confidence interval of the mean of at least two numbers, in which it lies
/// with this probability: t_(1 - (1 - level) / 2) times the standard error.
double student_half_width(const Moments& sample, double level);

/// Significance of each of `tests` independent tests, so that under the hypothesis the chance that
/// any of them fails is `family`: 1 - (1 - family)^(1 / tests).
double sidak(double family, int tests);

}  // namespace driftlight
