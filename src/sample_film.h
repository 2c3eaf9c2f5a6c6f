// SPDX-License-Identifier: Apache-2.0
/// The film of integrators whose samples also reach other pixels than their own.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "driftlight/image.h"
#include "driftlight/random.h"
#include "driftlight/sensor.h"

namespace driftlight {

/// Sums of contributions by pixel, in double, through the filter of the camera. Those of a sample
/// to its own pixel are added at once if that is all the filter; splats are kept, and added in the
/// order of the samples once all samples of a batch are done. So all sums run in an order that does
/// not depend on threads, and no range of values is assumed. With layers, each contribution is also
/// added to the one that it names.
class SampleFilm {
 public:
  SampleFilm(const Camera& camera, std::uint64_t seed, int layers);

  /// Where one sample puts what it finds.
  class Sink;

  /// Adds one sample to each pixel: sampler.sample(film position, rng, sink), on copies of
  /// `prototype`, since samplers may keep their subpaths. Sample s of a pixel has its own stream.
  template <class Sampler>
  void pass(std::uint64_t index, const Sampler& prototype);

  /// Means over so many passes.
  Image image(double passes) const;
  /// Means of the layers, as channels NAME.R, NAME.G, NAME.B.
  Layers layers(const std::vector<std::string>& names, double passes) const;
  /// Contributions that were NaN or infinite, counted as no light.
  std::uint64_t non_finite() const { return non_finite_; }

 private:
  struct Splat {
    Vec2d film;
    Rgbd value;
    int layer;
  };
  /// Samples in a row of one task, and the most tasks whose splats are kept.
  static constexpr std::size_t kTask = 64;
  static constexpr std::size_t kTasks = 2048;

  struct alignas(64) Task {
    std::vector<Splat> splats;
    std::uint64_t non_finite = 0;
  };

  void add(std::size_t pixel, int layer, const Rgbd& value);
  /// Adds the splats of the first tasks.
  void merge(std::size_t tasks);

  const Camera& camera_;
  FilterWeights weights_;
  std::uint64_t seed_;
  std::vector<Rgbd> sums_;
  std::vector<Rgbd> layers_;  ///< layer after layer
  std::vector<Task> tasks_;
  std::uint64_t non_finite_ = 0;
};

class SampleFilm::Sink {
 public:
  Sink(SampleFilm& film, Task& task, std::size_t pixel, const Vec2d& position)
      : film_(film), task_(task), pixel_(pixel), position_(position) {}

  void add(const Rgbd& value, int layer = 0) {
    if (!film_.weights_.is_pixel()) return splat(position_, value, layer);
    if (value.allFinite())
      film_.add(pixel_, layer, value);
    else
      ++task_.non_finite;
  }
  /// At film coordinates in [0, 1)^2.
  void splat(const Vec2d& film, const Rgbd& value, int layer = 0) {
    if (value.allFinite())
      task_.splats.push_back({film, value, layer});
    else
      ++task_.non_finite;
  }

 private:
  SampleFilm& film_;
  Task& task_;
  std::size_t pixel_;
  Vec2d position_;  ///< of the sample
};

template <class Sampler>
void SampleFilm::pass(std::uint64_t index, const Sampler& prototype) {
  const auto width = static_cast<std::size_t>(camera_.film_width);
  for (std::size_t start = 0; start < sums_.size(); start += kTask * kTasks) {
    const std::size_t end = std::min(start + kTask * kTasks, sums_.size());
    const std::size_t tasks = (end - start + kTask - 1) / kTask;
    tbb::parallel_for(std::size_t{0}, tasks, [&](std::size_t i) {
      Sampler sampler = prototype;
      const std::size_t first = start + i * kTask;
      for (std::size_t pixel = first; pixel < std::min(first + kTask, end); ++pixel) {
        Rng rng(seed_, Stream::Pixel, index * sums_.size() + pixel);
        const std::size_t x = pixel % width;
        const std::size_t y = pixel / width;
        const Vec2d jitter = rng.uniform2();
        const Vec2d film{(static_cast<double>(x) + jitter.x()) / camera_.film_width,
                         (static_cast<double>(y) + jitter.y()) / camera_.film_height};
        Sink sink(*this, tasks_[i], pixel, film);
        sampler.sample(film, rng, sink);
      }
    });
    merge(tasks);
  }
}

}  // namespace driftlight
