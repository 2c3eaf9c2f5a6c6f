// SPDX-License-Identifier: Apache-2.0
/// The page of a comparison.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace driftlight::cli {

/// A picture of the page.
struct PagePicture {
  std::string name;             ///< as it is shown
  std::filesystem::path image;  ///< PNG
  std::filesystem::path error;  ///< PNG, empty for the reference
};

/// A whole page that needs no other file: the results, the pictures in the order in which they are
/// flipped through, and the scale of the errors' colours. Throws RuntimeError if a picture cannot
/// be read.
std::string page_text(const nlohmann::ordered_json& results,
                      const std::vector<PagePicture>& pictures,
                      const std::filesystem::path& error_scale);

}  // namespace driftlight::cli
