// SPDX-License-Identifier: Apache-2.0
/// What each term of the Langevin step brings: a comparison that is ready made.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/arguments.h"

namespace driftlight::cli {

/// Long-lived chains with every preconditioner, drift and time-step rule, alike in all else. The
/// steps without a matrix have the size that was best for them on `glossy_chain`. The rules are the
/// default, and a careful one that divides dt by 10 and bounds it by 0.01 ([E63], section 6). All
/// of them have the settings `shared`. Throws UsageError if one of these is what the study varies.
std::vector<IntegratorChoice> terms_of_the_step(const Settings& shared);

/// One line for each of these: what it reaches at equal time, with its mutations, and at equal
/// mutations, with its time. Errors are relMSE against the reference, or of the spread without one.
std::string terms_table(const nlohmann::ordered_json& equal_time,
                        const nlohmann::ordered_json& equal_mutations);
std::string terms_csv(const nlohmann::ordered_json& equal_time,
                      const nlohmann::ordered_json& equal_mutations);

}  // namespace driftlight::cli
