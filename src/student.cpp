// SPDX-License-Identifier: Apache-2.0
#include "student.h"

#include <boost/math/distributions/students_t.hpp>
#include <cmath>

namespace driftlight {

void Moments::add(double x) {
  ++count_;
  const double difference = x - mean_;
  mean_ += difference / static_cast<double>(count_);
  squares_ += difference * (x - mean_);
}

double Moments::variance() const {
  return count_ > 1 ? squares_ / static_cast<double>(count_ - 1) : 0.0;
}

double Moments::error() const { return std::sqrt(variance() / static_cast<double>(count_)); }

double student_two_sided(double t, double degrees) {
  if (!std::isfinite(t)) return 0.0;
  const boost::math::students_t distribution(degrees);
  return 2.0 * boost::math::cdf(boost::math::complement(distribution, std::abs(t)));
}

double student_p_value(const Moments& sample, double expected) {
  const double difference = sample.mean() - expected;
  if (difference == 0.0) return 1.0;
  return student_two_sided(difference / sample.error(), static_cast<double>(sample.count()) - 1.0);
}

double student_half_width(const Moments& sample, double level) {
  const boost::math::students_t distribution(static_cast<double>(sample.count()) - 1.0);
  const double t =
      boost::math::quantile(boost::math::complement(distribution, 0.5 * (1.0 - level)));
  return t * sample.error();
}

double sidak(double family, int tests) {
  return -std::expm1(std::log1p(-family) / static_cast<double>(tests));
}

}  // namespace driftlight
