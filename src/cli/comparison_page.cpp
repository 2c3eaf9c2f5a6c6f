// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison_page.h"

#include <OpenImageIO/strutil.h>
#include <fmt/format.h>

#include <fstream>
#include <sstream>
#include <string_view>

#include "cli/error_map.h"
#include "cli/page/page_text.h"
#include "driftlight/error.h"

namespace driftlight::cli {

namespace {

using Json = nlohmann::ordered_json;

std::string data_uri(const std::filesystem::path& png) {
  std::ostringstream bytes;
  const std::ifstream file(png, std::ios::binary);
  bytes << file.rdbuf();
  if (!file) throw RuntimeError(fmt::format("cannot read '{}'", png.string()));
  return "data:image/png;base64," + OIIO::Strutil::base64_encode(bytes.str());
}

/// JSON in which nothing ends the element of the page that it stands in.
std::string for_page(const Json& json) {
  std::string text;
  for (const char c : json.dump()) {
    if (c == '<')
      text += "\\u003c";
    else
      text += c;
  }
  return text;
}

/// The page with what stands for its parts replaced, each once and in this order.
std::string fill(const std::vector<std::pair<std::string_view, std::string_view>>& parts) {
  std::string text;
  std::string_view rest = kPageHTML;
  for (const auto& [mark, content] : parts) {
    const std::size_t at = rest.find(mark);
    text.append(rest.substr(0, at)).append(content);
    rest.remove_prefix(at + mark.size());
  }
  return text.append(rest);
}

}  // namespace

std::string page_text(const nlohmann::ordered_json& results,
                      const std::vector<PagePicture>& pictures,
                      const std::filesystem::path& error_scale) {
  Json shown = Json::array();
  for (const PagePicture& picture : pictures)
    shown.push_back({{"name", picture.name},
                     {"image", data_uri(picture.image)},
                     {"error", picture.error.empty() ? Json() : Json(data_uri(picture.error))}});
  const Json data{
      {"results", results},
      {"pictures", shown},
      {"error_scale",
       {{"image", data_uri(error_scale)}, {"low", kLeastError}, {"high", kLargestError}}}};
  const std::string json = for_page(data);
  return fill({{"{{style}}", kPageCSS}, {"{{data}}", json}, {"{{script}}", kPageJS}});
}

}  // namespace driftlight::cli
