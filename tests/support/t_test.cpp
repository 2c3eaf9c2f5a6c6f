// SPDX-License-Identifier: Apache-2.0
#include "support/t_test.h"

#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace driftlight::test {

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
  return student_two_sided((a.mean() - b.mean()) / std::sqrt(s), degrees);
}

double normal_p_value(double z) {
  if (!std::isfinite(z)) return 0.0;
  const boost::math::normal distribution;
  return 2.0 * boost::math::cdf(boost::math::complement(distribution, std::abs(z)));
}

}  // namespace driftlight::test
