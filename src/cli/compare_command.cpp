// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cli/commands.h"
#include "cli/comparison.h"
#include "cli/comparison_page.h"
#include "cli/comparison_results.h"
#include "cli/error_map.h"
#include "cli/interrupt.h"
#include "cli/print.h"
#include "cli/progress_bar.h"
#include "cli/scene.h"
#include "cli/terms_study.h"
#include "cli/text_file.h"
#include "driftlight/error.h"
#include "driftlight/image.h"
#include "driftlight/running_mean.h"
#include "driftlight/scalar.h"
#include "pending_folder.h"

namespace driftlight::cli {

namespace {

/// Least mean luminance of a shown image.
constexpr double kShownMean = 0.12;

/// Throws InputError if it cannot be read or is not of the scene's size.
std::optional<Image> read_reference(const CompareCommand& command, const Camera& camera) {
  if (!command.reference) return std::nullopt;
  Image image = read_image(*command.reference);
  if (image.width != camera.film_width || image.height != camera.film_height)
    throw InputError(fmt::format("the reference '{}' has {} x {} pixels, the scene {} x {}",
                                 command.reference->string(), image.width, image.height,
                                 camera.film_width, camera.film_height));
  return image;
}

LoadedScene load_with_notices(const CompareCommand& command) {
  LoadedScene loaded = load(command.scene);
  for (const std::string& notice : loaded.notices) print_notice(notice);
  return loaded;
}

/// Says each notice once.
void take_depths(const LoadedScene& loaded, std::vector<Contender>& contenders) {
  std::set<std::string> notices;
  for (Contender& contender : contenders)
    notices.insert(take_depth(loaded, contender.choice.settings, contender.options));
  for (const std::string& notice : notices)
    if (!notice.empty()) print_notice(notice);
}

/// The least power of two at which the shown luminance, at most 1 in a pixel, is bright enough in
/// the mean; 1 for a black image. Lamps and dark corners do not decide it.
double exposure_for(const Image& image) {
  for (double exposure = 0x1p-20; exposure <= 0x1p20; exposure *= 2.0) {
    RunningMean shown;
    for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
      const double y =
          luminance(Rgbd(static_cast<double>(image.rgb[i]), static_cast<double>(image.rgb[i + 1]),
                         static_cast<double>(image.rgb[i + 2])));
      shown.add(y > 0.0 ? std::min(exposure * y, 1.0) : 0.0);
    }
    if (shown.mean() >= kShownMean) return exposure;
  }
  return 1.0;
}

void write_exposed(const std::filesystem::path& file, Image image, double exposure) {
  for (float& x : image.rgb) x *= static_cast<float>(exposure);
  write_image(file, image);
}

/// Writes the images of a contender: its first run, and where that is wrong.
PagePicture write_pictures(const std::filesystem::path& folder, const Contender& contender,
                           const std::optional<Image>& reference, const Image& expected,
                           double exposure) {
  const std::string stem = file_stem(contender.choice);
  const Image& image = contender.final_image(0);
  PagePicture picture{contender.choice.name, folder / (stem + ".png"),
                      folder / (stem + "_error.png")};
  write_image(folder / (stem + ".exr"), image, contender.runs.front().metadata);
  write_exposed(picture.image, image, exposure);
  const std::vector<double> errors = reference
                                         ? pixel_errors(image, *reference)
                                         : pixel_spread(image, contender.final_image(1), expected);
  write_image(picture.error, error_map(errors, image.width));
  return picture;
}

void write_all(const std::filesystem::path& folder, const std::vector<Contender>& contenders,
               const std::optional<Image>& reference, const Image& expected,
               nlohmann::ordered_json& results) {
  const double exposure = exposure_for(expected);
  results["exposure"] = exposure;
  std::vector<PagePicture> pictures;
  if (reference) {
    pictures.push_back({"reference", folder / "reference.png", {}});
    write_exposed(pictures.back().image, *reference, exposure);
  }
  for (const Contender& contender : contenders)
    pictures.push_back(write_pictures(folder, contender, reference, expected, exposure));
  const std::filesystem::path scale = folder / "error_scale.png";
  write_image(scale, error_scale(256));
  write_text(folder / "results.json", results.dump(2) + "\n");
  write_text(folder / "results.csv", csv_text(results));
  write_text(folder / "report.html", page_text(results, pictures, scale));
}

struct Compared {
  std::vector<Contender> contenders;
  Image expected;
  nlohmann::ordered_json results;
};

/// Renders all runs with one budget.
Compared compare(const LoadedScene& loaded, const SceneIdentity& identity,
                 const CompareCommand& command, const Work& work,
                 const std::optional<Image>& reference) {
  std::vector<Contender> contenders = contenders_of(command.integrators, work);
  take_depths(loaded, contenders);
  {
    ProgressBar bar(true);
    render_runs(
        loaded.scene, command, work, stop_on_interrupt(),
        [&](const Progress& progress) { bar.update(progress); }, contenders);
  }
  for (Contender& contender : contenders)
    for (Run& run : contender.runs) add_scene(identity, run.metadata, run.statistics);
  const std::size_t complete = contenders.front().runs.size();
  if (complete < static_cast<std::size_t>(command.runs))
    print_notice(fmt::format("stopped early: {} of {} runs of each", complete, command.runs));
  Image expected = expected_image(contenders, reference);
  nlohmann::ordered_json results =
      comparison_results(command, work, contenders, reference, expected);
  return {std::move(contenders), std::move(expected), std::move(results)};
}

/// What the terminal shows; the table of a whole study also goes into its folder.
std::string summarize(const std::vector<nlohmann::ordered_json>& results,
                      const std::filesystem::path& folder) {
  if (results.size() == 1) return summary_text(results.front());
  write_text(folder / "terms.csv", terms_csv(results[0], results[1]));
  return terms_table(results[0], results[1]);
}

}  // namespace

void run(const CompareCommand& command) {
  for (const Budget& budget : command.budgets) contenders_of(command.integrators, budget.work);
  check_folder_target(command.folder);
  const LoadedScene loaded = load_with_notices(command);
  const SceneIdentity identity = identity_of(command.scene, loaded);
  const std::optional<Image> reference = read_reference(command, loaded.scene.camera());
  if (!reference)
    print_notice(
        "there is no reference: errors follow from the spread between runs, which shows no bias");

  // Made when there is something to put into it.
  std::optional<PendingFolder> pending;
  std::vector<nlohmann::ordered_json> results;
  std::string written;
  for (const Budget& budget : command.budgets) {
    std::optional<Compared> compared;
    try {
      compared = compare(loaded, identity, command, budget.work, reference);
    } catch (const StoppedTooEarly&) {
      if (results.empty()) throw;
      print_notice(fmt::format("stopped early: there is no {}", budget.folder));
      break;
    }
    if (!pending) pending.emplace(command.folder);
    const std::filesystem::path folder = pending->temporary() / budget.folder;
    std::filesystem::create_directories(folder);
    write_all(folder, compared->contenders, reference, compared->expected, compared->results);
    results.push_back(std::move(compared->results));
    written += fmt::format("wrote {}\n", (command.folder / budget.folder / "report.html").string());
  }
  const std::string summary = summarize(results, pending->temporary());
  pending->commit();
  print(summary + written);
}

}  // namespace driftlight::cli
