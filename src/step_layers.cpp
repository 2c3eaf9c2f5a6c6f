// SPDX-License-Identifier: Apache-2.0
#include "driftlight/step_layers.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "driftlight/linearization.h"

namespace driftlight {
namespace {

constexpr double kMaxGradientNorm = 0x1p24;
constexpr double kMaxAcceptance = 1;
constexpr double kMaxAnisotropy = 16;
constexpr double kMaxTimeStep = 1;
/// Units of the largest value of a channel.
constexpr double kUnits = 0x1p34;

std::int64_t to_units(double x, double largest) {
  if (!(x < largest)) return static_cast<std::int64_t>(kUnits);  // NaN too
  const auto units = static_cast<std::int64_t>(std::llrint(x / largest * kUnits));
  return x > 0.0 ? std::max<std::int64_t>(units, 1) : 0;
}

void add_to(std::atomic<std::int64_t>& sum, std::int64_t units) {
  sum.fetch_add(units, std::memory_order_relaxed);
}

float mean(const std::atomic<std::int64_t>& sum, double largest, std::int64_t count) {
  if (count == 0) return 0.0F;
  const auto units = static_cast<double>(sum.load(std::memory_order_relaxed));
  return static_cast<float>(units / kUnits * largest / static_cast<double>(count));
}

}  // namespace

double log_condition(const Factor& factor, int dimension) {
  if (std::holds_alternative<IdentityFactor>(factor)) return 0.0;
  Matrix f(dimension, dimension);
  for (int j = 0; j < dimension; ++j)
    f.col(j) = std::visit(
        [&](const auto& root) { return root.apply(Vector(Vector::Unit(dimension, j))); }, factor);
  const Matrix q = f.transpose() * f;
  const Vector eigenvalues =
      Eigen::SelfAdjointEigenSolver<Matrix>(q, Eigen::EigenvaluesOnly).eigenvalues();
  const double largest = eigenvalues[dimension - 1];
  const double rounding = std::numeric_limits<double>::epsilon() * largest;
  return std::log10(largest / std::max(eigenvalues[0], rounding));
}

StepFigures step_figures(const Scene& scene, const PathTopology& topology, const Chart& chart,
                         DerivativeMethod method, const StepDistribution& step) {
  Linearization path;
  linearize(scene, topology, chart, method, {.gradient = true, .constraints = false}, path);
  return {.gradient_norm = path.gradient.norm(),
          .anisotropy = log_condition(step.factor(), step.dimension())};
}

StepLayers::StepLayers(int width, int height)
    : width_(width),
      height_(height),
      pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

void StepLayers::add(const Vec2d& film, double acceptance, const StepFigures* figures,
                     double time_step) {
  const int x = std::clamp(static_cast<int>(film.x() * width_), 0, width_ - 1);
  const int y = std::clamp(static_cast<int>(film.y() * height_), 0, height_ - 1);
  Pixel& pixel = pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                         static_cast<std::size_t>(x)];
  add_to(pixel.mutations, 1);
  add_to(pixel.acceptance, to_units(acceptance, kMaxAcceptance));
  if (figures == nullptr) return;
  add_to(pixel.steps, 1);
  add_to(pixel.gradient_norm, to_units(figures->gradient_norm, kMaxGradientNorm));
  add_to(pixel.anisotropy, to_units(figures->anisotropy, kMaxAnisotropy));
  add_to(pixel.time_step, to_units(time_step, kMaxTimeStep));
}

Layers StepLayers::develop() const {
  Layers layers{.width = width_,
                .height = height_,
                .names = {"gradient_norm", "acceptance", "anisotropy", "time_step", "mutations"},
                .values = {}};
  layers.values.reserve(pixels_.size() * layers.names.size());
  for (const Pixel& pixel : pixels_) {
    const std::int64_t mutations = pixel.mutations.load(std::memory_order_relaxed);
    const std::int64_t steps = pixel.steps.load(std::memory_order_relaxed);
    layers.values.insert(layers.values.end(), {mean(pixel.gradient_norm, kMaxGradientNorm, steps),
                                               mean(pixel.acceptance, kMaxAcceptance, mutations),
                                               mean(pixel.anisotropy, kMaxAnisotropy, steps),
                                               mean(pixel.time_step, kMaxTimeStep, steps),
                                               static_cast<float>(mutations)});
  }
  return layers;
}

}  // namespace driftlight
