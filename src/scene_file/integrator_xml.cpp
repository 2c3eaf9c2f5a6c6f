// SPDX-License-Identifier: Apache-2.0
#include "integrator_xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "nearest_names.h"
#include "properties.h"
#include "text.h"

namespace driftlight {
namespace {

constexpr std::array<std::string_view, 2> kUsed{"maxDepth", "hideEmitters"};

/// The depth of `direct`, which has no other: emitted light, and light that is reflected once.
constexpr int kDirectDepth = 2;
bool is_direct(const Properties& properties) { return properties.type() == "direct"; }

/// What Mitsuba's path tracer knows besides.
constexpr std::array<std::string_view, 5> kUnusedOfPath{"rrDepth", "strictNormals",
                                                        "samplesPerPass", "blockSize", "timeout"};

void note_unused_of_path(Properties& properties, LoadContext& context) {
  std::vector<std::string> unused;
  for (const std::string_view name : kUnusedOfPath)
    if (properties.has(name)) unused.push_back(spelling(name, properties.dialect()));
  if (!unused.empty())
    context.notice(properties.element(),
                   fmt::format("{} of {} {} not used", join(unused), properties.description(),
                               unused.size() == 1 ? "is" : "are"));
}

/// One notice is enough of whatever the integrators of others know, but for what may be a slip of
/// what is used.
void note_other(Properties& properties, LoadContext& context) {
  const std::string what =
      is_direct(properties)
          ? fmt::format(
                "what it renders are paths of up to {} edges, which is the depth unless "
                "another is given",
                kDirectDepth)
          : fmt::format("only its {} is used", spelling("maxDepth", properties.dialect()));
  context.notice(properties.element(), properties.description() + " is not driftlight's; " + what);
  for (const Element& child : properties.unused()) {
    const std::string name = child.find("name").value_or("");
    const bool may_be_slip = std::any_of(
        kUsed.begin(), kUsed.end(), [&](std::string_view used) { return is_slip(name, used); });
    if (!name.empty() && !may_be_slip) properties.ignore({name});
  }
}

}  // namespace

std::optional<std::optional<int>> read_integrator(const Element& element, LoadContext& context) {
  Properties properties(element);
  std::optional<std::optional<int>> result;
  if (is_direct(properties)) result = std::optional<int>(kDirectDepth);
  if (properties.boolean("hideEmitters", false))
    properties.fail("hideEmitters", "hiding emitters is not supported");
  if (const auto depth = properties.find("maxDepth")) result = read_max_depth(*depth);
  const std::vector<Element> nested_integrators = properties.nested({"integrator"});
  const bool is_ours = properties.type() == "langevin" || properties.type() == "path";
  if (is_ours)
    note_unused_of_path(properties, context);
  else
    note_other(properties, context);
  for (const Element& nested : nested_integrators)
    if (const auto depth = read_integrator(nested, context)) result = depth;
  properties.finish();
  context.objects.define(element, NamedObjects::Other{});
  return result;
}

std::optional<int> read_max_depth(const Element& element) {
  element.allow_attributes({"name", "value"});
  const std::optional<int> depth = parse_integer(element.text("value"));
  if (!depth || *depth == 0 || *depth < -1)
    element.fail("the depth must be a positive integer, or -1 for no bound");
  return *depth == -1 ? std::nullopt : depth;
}

}  // namespace driftlight
