// SPDX-License-Identifier: Apache-2.0
#include "softened_bsdf.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "nested_bsdfs.h"

namespace driftlight {
namespace {

double roughness_of(double exponent) { return std::sqrt(2.0 / (exponent + 2.0)); }
double exponent_of(double roughness) { return 2.0 / (roughness * roughness) - 2.0; }

}  // namespace

double least_roughness(const Bsdf& bsdf) {
  double least = std::visit(
      [](const auto& b) {
        if constexpr (requires { b.microfacets.alpha_u; })
          return std::min(b.microfacets.alpha_u, b.microfacets.alpha_v);
        else if constexpr (requires { b.alpha_u; })
          return std::min(b.alpha_u, b.alpha_v);
        else if constexpr (requires { b.exponent; })
          return roughness_of(b.exponent);
        else
          return kInfinity;
      },
      bsdf);
  for_each_nested(bsdf,
                  [&](const Bsdf& nested) { least = std::min(least, least_roughness(nested)); });
  return least;
}

Bsdf softened(Bsdf bsdf, double alpha) {
  const auto soften = [&](auto& rough) {
    rough.alpha_u = std::max(rough.alpha_u, alpha);
    rough.alpha_v = std::max(rough.alpha_v, alpha);
  };
  std::visit(
      [&](auto& b) {
        if constexpr (requires { b.microfacets.alpha_u; })
          soften(b.microfacets);
        else if constexpr (requires { b.alpha_u; })
          soften(b);
        else if constexpr (requires { b.exponent; })
          b.exponent = std::min(b.exponent, exponent_of(alpha));
      },
      bsdf);
  for_each_nested(bsdf, [&](Bsdf& nested) { nested = softened(nested, alpha); });
  return bsdf;
}

}  // namespace driftlight
