// SPDX-License-Identifier: Apache-2.0
#include "load_context.h"

#include <algorithm>

#include "nearest_names.h"

namespace driftlight {

void NamedObjects::define(const Element& element, Object object) {
  const auto id = element.find("id");
  if (!id) return;
  if (!objects_.emplace(*id, Entry{element, std::move(object)}).second)
    element.fail("the id '" + *id + "' is already taken");
}

void NamedObjects::define_failed(const Element& element) {
  for (const std::string& id : element.ids()) objects_.emplace(id, Entry{element, Failed{}});
}

void NamedObjects::define_alias(const Element& alias) {
  alias.allow_attributes({"id", "as"});
  const auto found = objects_.find(alias.text("id"));
  if (found == objects_.end()) fail_unknown(alias);
  const std::string other = alias.text("as");
  if (!objects_.emplace(other, Entry{alias, found->second.object}).second)
    alias.fail("the id '" + other + "' is already taken");
}

std::optional<Element> NamedObjects::find_ahead(const Element& ref, std::string_view tag) const {
  const std::string id = ref.text("id");
  if (ref.dialect() != Dialect::Mitsuba3 || objects_.contains(id)) return std::nullopt;
  const std::optional<Element> target = ref.find_id(id);
  if (!target || target->tag() != tag || ref.is_inside(*target)) return std::nullopt;
  if (std::find(pending_.begin(), pending_.end(), *target) != pending_.end())
    ref.fail("cyclic reference: '" + id + "' needs the element with this <ref>");
  return target;
}

const NamedObjects::Object& NamedObjects::find(const Element& ref) const {
  ref.allow_attributes({"id", "name"});
  const std::string id = ref.text("id");
  if (const auto found = objects_.find(id); found != objects_.end()) {
    if (std::holds_alternative<Failed>(found->second.object))
      throw Unreadable(ref.location(), "'" + id + "' could not be read");
    return found->second.object;
  }

  if (const auto target = ref.find_id(id)) {
    if (ref.is_inside(*target)) ref.fail("cyclic reference: '" + id + "' contains this <ref>");
    ref.fail("'" + id + "' is defined only further down, at " + to_string(target->location()) +
             "; move it above this <ref>");
  }
  fail_unknown(ref);
}

void NamedObjects::fail_unknown(const Element& element) const {
  std::vector<std::string> known;
  for (const auto& [name, entry] : objects_) known.push_back(name);
  const std::string id = element.text("id");
  element.fail("nothing has the id '" + id + "'; " + hint(id, known));
}

}  // namespace driftlight
