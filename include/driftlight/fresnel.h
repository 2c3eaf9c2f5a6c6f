// SPDX-License-Identifier: Apache-2.0
/// Fresnel reflectance of dielectrics and conductors, unpolarised.
#pragma once

#include <cmath>

#include "driftlight/scalar.h"

namespace driftlight {

/// Reflectance of a smooth dielectric interface. `cos_i` >= 0 is the cosine on the incident side
/// and `eta` the index beyond over the index on the incident side. Total internal reflection gives
/// 1 with no derivative: the branch cuts it, as the physics does.
///   r_par = (eta c_i - c_t) / (eta c_i + c_t),  r_perp = (c_i - eta c_t) / (c_i + eta c_t)
template <Scalar T>
T fresnel_dielectric(const T& cos_i, double eta) {
  using std::sqrt;
  const T cos_t_squared = 1.0 - (1.0 - cos_i * cos_i) * (1.0 / (eta * eta));
  if (value(cos_t_squared) <= 0.0) return constant<T>(1.0);
  const T cos_t = sqrt(cos_t_squared);
  const T parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const T perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

/// Reflectance of a conductor with relative index eta + i k (per colour), exact formula:
///   a^2 + b^2 = sqrt((eta^2 - k^2 - s^2)^2 + 4 eta^2 k^2),  2 a^2 = a^2 + b^2 + eta^2 - k^2 - s^2,
///   R_s = (A + c^2 - 2 a c) / (A + c^2 + 2 a c),
///   R_p = R_s (c^2 A + s^4 - 2 a c s^2) / (c^2 A + s^4 + 2 a c s^2),   A = a^2 + b^2,
/// with c, s the cosine and sine of incidence (Born and Wolf, Principles of Optics, 13.4).
template <Scalar T>
T fresnel_conductor(const T& cos_i, double eta, double k) {
  using std::sqrt;
  const T cos2 = cos_i * cos_i;
  const T sin2 = 1.0 - cos2;
  const T difference = (eta * eta - k * k) - sin2;
  const T sum = sqrt(difference * difference + 4.0 * eta * eta * k * k);
  // Two forms of one value. The second has no cancellation where sum + difference is small, and at
  // eta = 0 (a perfect mirror) or total reflection (k = 0) it is 0 with derivative 0.
  const T a = value(difference) >= 0.0 ? T(sqrt(0.5 * (sum + difference)))
                                       : T(std::sqrt(2.0) * eta * k / sqrt(sum - difference));
  const T s1 = sum + cos2;
  const T s2 = 2.0 * a * cos_i;
  const T perpendicular = (s1 - s2) / (s1 + s2);
  const T p1 = cos2 * sum + sin2 * sin2;
  const T p2 = s2 * sin2;
  const T parallel = perpendicular * ((p1 - p2) / (p1 + p2));
  return 0.5 * (parallel + perpendicular);
}

template <Scalar T>
Rgb<T> fresnel_conductor(const T& cos_i, const Rgbd& eta, const Rgbd& k) {
  return {fresnel_conductor(cos_i, eta.x(), k.x()), fresnel_conductor(cos_i, eta.y(), k.y()),
          fresnel_conductor(cos_i, eta.z(), k.z())};
}

}  // namespace driftlight
