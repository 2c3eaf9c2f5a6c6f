// SPDX-License-Identifier: Apache-2.0
/// Laws of the layers: they hold the means over what each small step starts from, and neither
/// threads nor the layers themselves show in what comes out.
#include "driftlight/step_layers.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "driftlight/chain.h"
#include "driftlight/error.h"
#include "driftlight/render.h"
#include "support/dense.h"
#include "support/scene_directory.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

/// Order of the values of a pixel.
enum Channel { GradientNorm, Acceptance, Anisotropy, TimeStep, Mutations, ChannelCount };

double at(const Layers& layers, std::size_t pixel, Channel channel) {
  return static_cast<double>(layers.values[ChannelCount * pixel + channel]);
}

std::size_t pixel_count(const Layers& layers) { return layers.values.size() / ChannelCount; }

// ---- The sums -----------------------------------------------------------------------------------

// Law: means over the mutations of each pixel, zero where there is none; a mutation without figures
// counts in the acceptance only.
TEST(StepLayers, AreMeansOverTheMutationsOfAPixel) {
  StepLayers layers(3, 2);
  const StepFigures first{.gradient_norm = 10, .anisotropy = 3};
  const StepFigures second{.gradient_norm = 40, .anisotropy = 0};
  layers.add({0.5, 0.75}, 1.0, &first, 0.25);
  layers.add({0.6, 0.99}, 0.5, &second, 0.125);
  layers.add({0.4, 0.51}, 0.0, nullptr, 0.0);
  const Layers result = layers.develop();
  EXPECT_EQ(result.width, 3);
  EXPECT_EQ(result.height, 2);
  EXPECT_EQ(result.names, (std::vector<std::string>{"gradient_norm", "acceptance", "anisotropy",
                                                    "time_step", "mutations"}));
  ASSERT_EQ(pixel_count(result), 6U);
  constexpr std::size_t kPixel = 4;
  EXPECT_EQ(at(result, kPixel, GradientNorm), 25.0);
  EXPECT_EQ(at(result, kPixel, Acceptance), 0.5);
  EXPECT_EQ(at(result, kPixel, Anisotropy), 1.5);
  EXPECT_EQ(at(result, kPixel, TimeStep), 0.1875);
  EXPECT_EQ(at(result, kPixel, Mutations), 3.0);
  for (std::size_t i = 0; i < result.values.size(); ++i)
    EXPECT_TRUE(i / ChannelCount == kPixel || result.values[i] == 0.0F) << i;
}

// Law: what is beyond the range counts as its end, and what is positive stays so.
TEST(StepLayers, SaturateAndNeverVanish) {
  const double infinity = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double huge : {1e9, infinity, nan}) {
    StepLayers layers(1, 1);
    const StepFigures figures{.gradient_norm = huge, .anisotropy = huge};
    layers.add({0.5, 0.5}, 1.0, &figures, 1e-300);
    const Layers result = layers.develop();
    EXPECT_EQ(at(result, 0, GradientNorm), 0x1p24);
    EXPECT_EQ(at(result, 0, Anisotropy), 16.0);
    EXPECT_GT(at(result, 0, TimeStep), 0.0);
    EXPECT_LT(at(result, 0, TimeStep), 1e-10);
  }
}

// ---- The figures --------------------------------------------------------------------------------

// Law: the anisotropy is the condition of the dense Q of wide Jets by its eigenvalues, and the
// gradient norm that of their gradient, in every class of path.
TEST(StepFigures, EqualTheDenseComputation) {
  int ill_conditioned = 0;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, 300, 61)) {
      ChainState state;
      state.topology = path.topology;
      state.coordinates = path.coordinates;
      prepare_step(test.scene, KernelOptions{}, state);
      const StepFigures figures =
          step_figures(test.scene, state.topology, state.chart, DerivativeMethod::Hand, state.step);
      PathDerivatives wide;
      differentiate(test.scene, state.topology, state.chart, {}, wide);
      EXPECT_NEAR(figures.gradient_norm, wide.gradient.norm(), 1e-7 * wide.gradient.norm());
      const Vector values = eigenvalues(wide.q);
      const double condition = values[values.size() - 1] / values[0];
      EXPECT_GE(figures.anisotropy, 0.0);
      if (!(condition < 1e9)) {
        // Rounding of the eigenvalues hides the smallest.
        ++ill_conditioned;
        continue;
      }
      EXPECT_NEAR(figures.anisotropy, std::log10(condition), 1e-5) << test.name;
    }
  }
  EXPECT_LT(ill_conditioned, 120);
}

TEST(StepFigures, ConditionOfKnownMatrices) {
  Matrix q = Matrix::Identity(3, 3);
  q(1, 1) = 1e4;
  q(2, 2) = 1e-3;
  EXPECT_NEAR(log_condition(*CholeskyFactor::of(q), 3), 7.0, 1e-12);
  EXPECT_EQ(log_condition(IdentityFactor(4), 4), 0.0);
  q(2, 2) = 1e-30;
  EXPECT_NEAR(log_condition(*CholeskyFactor::of(q), 3), 15.65, 0.01);
}

/// Adds up what a chain does, one mutation at a time.
struct Tally {
  double gradient_norm = 0;
  double acceptance = 0;
  double anisotropy = 0;
  double mutations = 0;

  void add(const Scene& scene, ChainState state, const KernelOptions& options, double accepted) {
    prepare_step(scene, options, state);
    const StepFigures figures =
        step_figures(scene, state.topology, state.chart, options.derivatives, state.step);
    gradient_norm += figures.gradient_norm;
    anisotropy += figures.anisotropy;
    acceptance += accepted;
    mutations += 1.0;
  }
};

// Law: every small step counts with the figures of the state from which it starts, among large
// steps, accepted and rejected ones.
TEST(StepLayers, HoldWhatEachSmallStepStartsFrom) {
  for (const TestScene& test : test_scenes()) {
    LangevinOptions options;
    options.mode = Mode::Chain;
    options.large_step_probability = 0.3;
    const PathSampler sampler(test.scene, test.max_depth);
    Film film(4, 4);
    StepLayers layers(1, 1);
    Chain chain(test.scene, sampler, options, film, light_paths(test, 1, 62).front(),
                Rng(63, Stream::Test, 0), &layers);
    Tally tally;
    for (int i = 0; i < 2000; ++i) {
      const ChainState from = chain.state();
      const KernelStatistics before = chain.statistics().small_step;
      chain.run(1);
      const KernelStatistics& after = chain.statistics().small_step;
      if (after.proposed > before.proposed)
        tally.add(test.scene, from, options.kernel, after.accepted - before.accepted);
    }
    const Layers result = layers.develop();
    EXPECT_EQ(at(result, 0, Mutations), tally.mutations);
    const auto mean = [&](double sum) { return sum / tally.mutations; };
    EXPECT_NEAR(at(result, 0, GradientNorm), mean(tally.gradient_norm),
                1e-6 * mean(tally.gradient_norm) + 1e-3)
        << test.name;
    EXPECT_NEAR(at(result, 0, Anisotropy), mean(tally.anisotropy), 1e-5) << test.name;
    EXPECT_NEAR(at(result, 0, Acceptance), mean(tally.acceptance), 1e-6) << test.name;
  }
}

// ---- Whole renders ------------------------------------------------------------------------------

LangevinOptions small_options(const TestScene& test) {
  LangevinOptions options;
  options.mode = Mode::Chain;
  options.max_depth = test.max_depth;
  options.bootstrap = 5000;
  options.chains = 16;
  return options;
}

/// Layers of the size of the film.
StepLayers layers_for(const Scene& scene) {
  return {scene.camera().film_width, scene.camera().film_height};
}

constexpr double kMutationsPerPixel = 60;

// Law: mutations and acceptance over all pixels are those of the statistics.
TEST(StepLayers, AddUpToTheStatistics) {
  for (const TestScene& test : test_scenes()) {
    StepLayers layers = layers_for(test.scene);
    RenderOptions render;
    render.layers = &layers;
    const LangevinResult rendered =
        render_langevin(test.scene, small_options(test), render, kMutationsPerPixel);
    const Layers result = layers.develop();
    double mutations = 0;
    double accepted = 0;
    for (std::size_t i = 0; i < pixel_count(result); ++i) {
      mutations += at(result, i, Mutations);
      accepted += at(result, i, Mutations) * at(result, i, Acceptance);
    }
    const KernelStatistics& expected = rendered.statistics.small_step;
    EXPECT_EQ(mutations, static_cast<double>(expected.proposed));
    EXPECT_NEAR(accepted / mutations, expected.acceptance(), 1e-7) << test.name;
  }
}

// Law: dt lies in (0, 1/3] and the anisotropy is positive wherever a step started; with the
// identity preconditioner the anisotropy is zero, and without drift dt is 1/3.
TEST(StepLayers, KeepTheirBounds) {
  const TestScene& test = test_scenes().front();
  for (const bool plain : {false, true}) {
    LangevinOptions options = small_options(test);
    if (plain) {
      options.kernel.preconditioner = PreconditionerKind::Identity;
      options.kernel.drift = Drift::None;
    }
    StepLayers layers = layers_for(test.scene);
    RenderOptions render;
    render.layers = &layers;
    render_langevin(test.scene, options, render, kMutationsPerPixel);
    const Layers result = layers.develop();
    for (std::size_t i = 0; i < pixel_count(result); ++i) {
      const bool visited = at(result, i, Mutations) > 0.0;
      EXPECT_EQ(at(result, i, TimeStep) > 0.0, visited);
      EXPECT_EQ(at(result, i, GradientNorm) > 0.0, visited);
      EXPECT_EQ(at(result, i, Anisotropy) > 0.0, visited && !plain);
      EXPECT_LE(at(result, i, TimeStep), 1.0 / 3.0 + 1e-7);
      EXPECT_LE(at(result, i, Acceptance), 1.0);
      if (plain && visited) {
        EXPECT_NEAR(at(result, i, TimeStep), 1.0 / 3.0, 1e-7);
      }
    }
  }
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

// Law: the file does not depend on the number of threads, but does on the seed; the image does not
// depend on whether there are layers.
TEST(StepLayers, NeitherThreadsNorLayersShow) {
  const TestScene& test = test_scenes()[1];
  const SceneDirectory directory;
  const auto render_with = [&](int threads, std::uint64_t seed, StepLayers* layers) {
    RenderOptions render;
    render.threads = threads;
    render.seed = seed;
    render.layers = layers;
    return render_langevin(test.scene, small_options(test), render, kMutationsPerPixel).image;
  };
  const Image without = render_with(2, 5, nullptr);
  const auto file_bytes = [&](int threads, std::uint64_t seed) {
    StepLayers layers = layers_for(test.scene);
    const Image image = render_with(threads, seed, &layers);
    EXPECT_EQ(image.rgb == without.rgb, seed == 5);
    const auto file = directory.path() / "layers.exr";
    write_layers(file, layers.develop());
    return bytes_of(file);
  };
  const std::string one = file_bytes(1, 5);
  EXPECT_GT(one.size(), 1000U);
  EXPECT_TRUE(file_bytes(2, 5) == one);
  EXPECT_TRUE(file_bytes(4, 5) == one);
  EXPECT_FALSE(file_bytes(2, 6) == one);
}

// ---- The file -----------------------------------------------------------------------------------

// Law: what is written is read back channel by channel, by name, with the metadata.
TEST(WriteLayers, KeepsNamesValuesAndMetadata) {
  const SceneDirectory directory;
  Layers layers{.width = 2, .height = 1, .names = {"b", "a"}, .values = {1, 2, 3, 4}};
  const auto file = directory.path() / "layers.exr";
  write_layers(file, layers, {{"driftlight:seed", "12"}});
  const auto input = OIIO::ImageInput::open(file.string());
  ASSERT_TRUE(input);
  const OIIO::ImageSpec& spec = input->spec();
  EXPECT_EQ(spec.nchannels, 2);
  EXPECT_EQ(spec.get_string_attribute("driftlight:seed"), "12");
  for (std::size_t c = 0; c < 2; ++c) {
    const int channel = spec.channelindex(layers.names[c]);
    ASSERT_GE(channel, 0) << layers.names[c];
    std::vector<float> values(2);
    ASSERT_TRUE(
        input->read_image(0, 0, channel, channel + 1, OIIO::TypeDesc::FLOAT, values.data()));
    EXPECT_EQ(values, (std::vector<float>{layers.values[c], layers.values[2 + c]}));
  }
  EXPECT_THROW(write_layers(directory.path() / "layers.png", layers), InputError);
  EXPECT_FALSE(std::filesystem::exists(directory.path() / "layers.png"));
}

}  // namespace
}  // namespace driftlight::test
