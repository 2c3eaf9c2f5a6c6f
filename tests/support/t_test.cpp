// SPDX-License-Identifier: Apache-2.0
#include "support/t_test.h"

#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

namespace driftlight::test {
namespace {

double two_sided(double t, double degrees) {
  if (!std::isfinite(t)) return 0.0;
  const boost::math::students_t distribution(degrees);
  return 2.0 * boost::math::cdf(boost::math::complement(distribution, std::abs(t)));
}

}  // namespace

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

double student_p_value(const Moments& sample, double expected) {
  const double difference = sample.mean() - expected;
  if (difference == 0.0) return 1.0;
  return two_sided(difference / sample.error(), static_cast<double>(sample.count()) - 1.0);
}

/// t = (m_a - m_b) / sqrt(s), s = v_a + v_b, with the degrees of freedom of Welch and
/// Satterthwaite, s^2 / (v_a^2 / (n_a - 1) + v_b^2 / (n_b - 1)).
double welch_p_value(const Moments& a, const Moments& b) {
  if (a.mean() == b.mean()) return 1.0;
  const double na = static_cast<double>(a.count());
  const double nb = static_cast<double>(b.count());
  const double va = a.variance() / na;
  const double vb = b.variance() / nb;
  const double s = va + vb;
  const double degrees = s * s / (va * va / (na - 1.0) + vb * vb / (nb - 1.0));
  return two_sided((a.mean() - b.mean()) / std::sqrt(s), degrees);
}

double sidak(double family, int tests) {
  return -std::expm1(std::log1p(-family) / static_cast<double>(tests));
}

double normal_p_value(double z) {
  if (!std::isfinite(z)) return 0.0;
  const boost::math::normal distribution;
  return 2.0 * boost::math::cdf(boost::math::complement(distribution, std::abs(z)));
}

}  // namespace driftlight::test
