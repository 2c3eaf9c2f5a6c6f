// SPDX-License-Identifier: Apache-2.0
#include "integrator_xml.h"

#include <fmt/format.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "properties.h"
#include "text.h"

namespace driftlight {
namespace {

/// What Mitsuba's integrators know besides: how they sample, and what we have options for.
constexpr std::array<std::string_view, 64> kUnusedParameters{"rrDepth",
                                                             "strictNormals",
                                                             "shadingSamples",
                                                             "emitterSamples",
                                                             "bsdfSamples",
                                                             "rayLength",
                                                             "lightImage",
                                                             "sampleDirect",
                                                             "bidirectional",
                                                             "bidirectionalMutation",
                                                             "lensPerturbation",
                                                             "multiChainPerturbation",
                                                             "causticPerturbation",
                                                             "manifoldPerturbation",
                                                             "lambda",
                                                             "pLarge",
                                                             "pSurvival",
                                                             "directSamples",
                                                             "luminanceSamples",
                                                             "separateDirect",
                                                             "twoStage",
                                                             "firstStage",
                                                             "firstStageSizeReduction",
                                                             "timeout",
                                                             "workUnits",
                                                             "mutationSizeLow",
                                                             "mutationSizeHigh",
                                                             "technique",
                                                             "kelemenStyleMutations",
                                                             "kelemenStyleWeights",
                                                             "numChains",
                                                             "maxChains",
                                                             "chainLength",
                                                             "granularity",
                                                             "globalPhotons",
                                                             "causticPhotons",
                                                             "volumePhotons",
                                                             "photonCount",
                                                             "maxPasses",
                                                             "initialRadius",
                                                             "reductionRatio",
                                                             "alpha",
                                                             "globalLookupRadius",
                                                             "causticLookupRadius",
                                                             "lookupSize",
                                                             "gatherLocally",
                                                             "autoCancelGathering",
                                                             "directTracing",
                                                             "clamping",
                                                             "shadowMapResolution",
                                                             "maxError",
                                                             "pValue",
                                                             "maxSampleFactor",
                                                             "resolution",
                                                             "quality",
                                                             "gradients",
                                                             "overture",
                                                             "indirectOnly",
                                                             "stokes",
                                                             "samplesPerPass",
                                                             "blockSize",
                                                             "aovs",
                                                             "field",
                                                             "dimensions"};

/// Ours, or with the same picture.
bool is_ours(const Properties& properties) {
  return properties.type() == "langevin" || properties.type() == "path";
}

void note_unused(Properties& properties, LoadContext& context) {
  std::vector<std::string> unused;
  for (const std::string_view name : kUnusedParameters)
    if (properties.has(name)) unused.push_back(spelling(name, properties.dialect()));
  if (!is_ours(properties))
    context.notice(properties.element(),
                   properties.description() + " is not driftlight's; only its " +
                       spelling("maxDepth", properties.dialect()) + " is used");
  else if (!unused.empty())
    context.notice(properties.element(),
                   fmt::format("{} of {} {} not used", join(unused), properties.description(),
                               unused.size() == 1 ? "is" : "are"));
}

}  // namespace

std::optional<std::optional<int>> read_integrator(const Element& element, LoadContext& context) {
  Properties properties(element);
  std::optional<std::optional<int>> result;
  if (properties.boolean("hideEmitters", false))
    properties.fail("hideEmitters", "hiding emitters is not supported");
  if (const auto depth = properties.find("maxDepth")) result = read_max_depth(*depth);
  note_unused(properties, context);
  for (const Element& nested : properties.nested({"integrator"}))
    if (const auto depth = read_integrator(nested, context)) result = depth;
  properties.finish();
  context.objects.define(element, NamedObjects::Other{});
  return result;
}

std::optional<int> read_max_depth(const Element& element) {
  const std::optional<int> depth = parse_integer(element.text("value"));
  if (!depth || *depth == 0 || *depth < -1)
    element.fail("the depth must be a positive integer, or -1 for no bound");
  return *depth == -1 ? std::nullopt : depth;
}

}  // namespace driftlight
