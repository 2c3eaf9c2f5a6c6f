// SPDX-License-Identifier: Apache-2.0
/// Tests of means: Student's, Welch's, and Sidak's correction for many of them.
#pragma once

#include <cstdint>

namespace driftlight::test {

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

/// Two-sided p-value of Student's test that the mean is `expected`.
double student_p_value(const Moments& sample, double expected);

/// Two-sided p-value of Welch's test that two means are equal; the variances may differ.
double welch_p_value(const Moments& a, const Moments& b);

/// Significance of each of `tests` independent tests, so that under the hypothesis the chance that
/// any of them fails is `family`: 1 - (1 - family)^(1 / tests).
double sidak(double family, int tests);

/// Two-sided p-value of a standard normal deviate.
double normal_p_value(double z);

}  // namespace driftlight::test
