// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/print.h"
#include "driftlight/image.h"

namespace driftlight::cli {

void run(const DiffCommand& command) {
  const Difference d = difference(read_image(command.image), read_image(command.reference));
  if (command.json) {
    const nlohmann::ordered_json json{{"mse", d.mse},
                                      {"relmse", d.relmse},
                                      {"relmse_trimmed", d.relmse_trimmed},
                                      {"mape", d.mape},
                                      {"mean_ratio", d.mean}};
    print(json.dump(2) + "\n");
    return;
  }
  print(
      fmt::format("MSE             {:.6g}\n"
                  "relMSE          {:.6g}\n"
                  "relMSE trimmed  {:.6g}  (without the worst 0.1 % of pixels)\n"
                  "MAPE            {:.6g}\n"
                  "mean ratio      {:.6g}\n",
                  d.mse, d.relmse, d.relmse_trimmed, d.mape, d.mean));
}

void run(const PrintCommand& command) { print(command.text); }

}  // namespace driftlight::cli
