// SPDX-License-Identifier: Apache-2.0
/// What the program does. Each prints its result to standard output and throws on failure.
#pragma once

#include "cli/arguments.h"

namespace driftlight::cli {

void run(const RenderCommand& command);
void run(const CompareCommand& command);
void run(const GradcheckCommand& command);
void run(const InfoCommand& command);
void run(const IntegratorsCommand& command);
void run(const DiffCommand& command);
void run(const PrintCommand& command);

}  // namespace driftlight::cli
