// SPDX-License-Identifier: Apache-2.0
/// SIGINT and SIGTERM end a render early.
#pragma once

#include <atomic>

namespace driftlight::cli {

/// From now on the first of these signals sets the flag that is returned, and the second ends the
/// program as ever.
const std::atomic<bool>& stop_on_interrupt();

}  // namespace driftlight::cli
