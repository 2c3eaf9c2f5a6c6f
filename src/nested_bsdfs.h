// SPDX-License-Identifier: Apache-2.0
/// BSDFs that others are made of.
#pragma once

#include <memory>
#include <type_traits>
#include <variant>

#include "driftlight/bsdf_models.h"

namespace driftlight {

/// Calls `visit` with each BSDF that this one is made of, but not with those that these are made
/// of. If they may be changed, copies take their places first, as others may share them.
template <class AnyBsdf, class Visit>
void for_each_nested(AnyBsdf& bsdf, const Visit& visit) {
  const auto visit_in = [&](auto& box) {
    if (box == nullptr) return;
    if constexpr (std::is_const_v<AnyBsdf>) {
      visit(box->bsdf);
    } else {
      const auto copy = std::make_shared<BsdfBox>(*box);
      visit(copy->bsdf);
      box = copy;
    }
  };
  std::visit(
      [&](auto& b) {
        if constexpr (requires { b.nested; }) visit_in(b.nested);
        if constexpr (requires { b.first; }) visit_in(b.first);
        if constexpr (requires { b.second; }) visit_in(b.second);
      },
      bsdf);
}

}  // namespace driftlight
