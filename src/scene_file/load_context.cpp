// SPDX-License-Identifier: Apache-2.0
#include "load_context.h"

#include "text.h"

namespace driftlight {

void NamedObjects::define(const Element& element, Object object) {
  const auto id = element.find("id");
  if (!id) return;
  if (!objects_.emplace(*id, std::move(object)).second)
    element.fail("the id '" + *id + "' is already taken");
}

const NamedObjects::Object& NamedObjects::find(const Element& ref) const {
  ref.allow_attributes({"id", "name"});
  const std::string id = ref.text("id");
  if (const auto found = objects_.find(id); found != objects_.end()) return found->second;

  if (const auto target = ref.find_id(id)) {
    if (ref.is_inside(*target)) ref.fail("cyclic reference: '" + id + "' contains this <ref>");
    ref.fail("'" + id + "' is defined only further down, at " + to_string(target->location()) +
             "; move it above this <ref>");
  }
  std::vector<std::string> known;
  for (const auto& [name, object] : objects_) known.push_back(name);
  ref.fail("nothing has the id '" + id + "'; valid are: " + (known.empty() ? "none" : join(known)));
}

}  // namespace driftlight
