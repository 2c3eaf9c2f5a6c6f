// SPDX-License-Identifier: Apache-2.0
#include "sample_film.h"

namespace driftlight {

SampleFilm::SampleFilm(const Camera& camera, std::uint64_t seed, int layers)
    : camera_(camera),
      weights_(camera.filter, camera.film_width, camera.film_height),
      seed_(seed),
      sums_(static_cast<std::size_t>(camera.film_width) *
                static_cast<std::size_t>(camera.film_height),
            Rgbd::Zero()),
      layers_(static_cast<std::size_t>(layers) * sums_.size(), Rgbd::Zero()),
      tasks_(kTasks) {}

void SampleFilm::add(std::size_t pixel, int layer, const Rgbd& value) {
  sums_[pixel] += value;
  if (!layers_.empty()) layers_[static_cast<std::size_t>(layer) * sums_.size() + pixel] += value;
}

void SampleFilm::merge(std::size_t tasks) {
  for (std::size_t i = 0; i < tasks; ++i) {
    Task& task = tasks_[i];
    for (const Splat& splat : task.splats) {
      if (weights_.is_pixel()) {
        add(camera_.pixel(splat.film), splat.layer, splat.value);
        continue;
      }
      weights_.spread(splat.film, [&](std::size_t pixel, double weight) {
        add(pixel, splat.layer, weight * splat.value);
      });
    }
    task.splats.clear();
    non_finite_ += task.non_finite;
    task.non_finite = 0;
  }
}

Image SampleFilm::image(double passes) const {
  Image result(camera_.film_width, camera_.film_height);
  const double scale = passes > 0.0 ? 1.0 / passes : 0.0;
  for (std::size_t i = 0; i < sums_.size(); ++i)
    for (int c = 0; c < 3; ++c)
      result.rgb[3 * i + static_cast<std::size_t>(c)] = static_cast<float>(sums_[i][c] * scale);
  return result;
}

Layers SampleFilm::layers(const std::vector<std::string>& names, double passes) const {
  Layers result{
      .width = camera_.film_width, .height = camera_.film_height, .names = {}, .values = {}};
  for (const std::string& name : names)
    for (const char* channel : {".R", ".G", ".B"}) result.names.push_back(name + channel);
  result.values.reserve(3 * layers_.size());
  const double scale = passes > 0.0 ? 1.0 / passes : 0.0;
  for (std::size_t pixel = 0; pixel < sums_.size(); ++pixel)
    for (std::size_t layer = 0; layer < names.size(); ++layer)
      for (int c = 0; c < 3; ++c)
        result.values.push_back(
            static_cast<float>(layers_[layer * sums_.size() + pixel][c] * scale));
  return result;
}

}  // namespace driftlight
