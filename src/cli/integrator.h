// SPDX-License-Identifier: Apache-2.0
/// Integrators by name, whichever it is.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "cli/arguments.h"
#include "cli/report.h"
#include "driftlight/image.h"
#include "driftlight/options.h"
#include "driftlight/render.h"
#include "driftlight/scene_file.h"

namespace driftlight::cli {

/// In the order of `Integrator`.
using IntegratorOptions =
    std::variant<LangevinOptions, PssmltOptions, MmltOptions, H2mcOptions, LmcOptions, MalaOptions,
                 MltOptions, ErptOptions, PathOptions, BdptOptions, LightOptions>;

/// The defaults.
IntegratorOptions options_of(Integrator integrator);

/// Bound to these options.
std::vector<OptionEntry> entries_of(IntegratorOptions& options);

/// Throws OptionError naming the option and the valid ones or values, also of one that does nothing
/// beside the others.
void apply(const Settings& settings, IntegratorOptions& options);

/// Unless one of the settings is the depth, takes it from the scene. A notice, empty if there is
/// nothing to say.
std::string take_depth(const LoadedScene& loaded, const Settings& settings,
                       IntegratorOptions& options);

/// If samples are the work and it is not given, takes it from the scene. A notice, empty if there
/// is nothing to say.
std::string take_sample_count(const LoadedScene& loaded, const IntegratorOptions& options,
                              Work& work);

/// True if mutations are its work, else samples are.
bool counts_mutations(const IntegratorOptions& options);

struct Rendered {
  Image image;
  Report report;
};

/// Renders for the time of `how`, or for the work.
Rendered render_with(const Scene& scene, IntegratorOptions& options, const RenderOptions& how,
                     const Work& work);

}  // namespace driftlight::cli
