// SPDX-License-Identifier: Apache-2.0
#include "driftlight/options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <system_error>

#include "driftlight/error.h"

namespace driftlight {

namespace {

/// Numbers that an option takes: [low, high], or (low, high] if `open`.
template <class T>
struct Range {
  T low;
  T high = std::numeric_limits<T>::max();
  bool open = false;

  bool contains(T x) const { return (open ? x > low : x >= low) && x <= high; }
};

std::string describe(const Range<double>& range) {
  if (range.high < std::numeric_limits<double>::max())
    return fmt::format("number in {}{}, {}]", range.open ? '(' : '[', range.low, range.high);
  return fmt::format("number {} {}", range.open ? ">" : ">=", range.low);
}

std::string describe(const Range<int>& range) {
  return fmt::format("integer in [{}, {}]", range.low, range.high);
}

/// The whole text as a finite number, or none.
template <class T>
std::optional<T> parse(const std::string& text) {
  T x{};
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, x);
  if (error != std::errc() || stop != end) return std::nullopt;
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(x)) return std::nullopt;
  }
  return x;
}

[[noreturn]] void fail(std::string_view name, const std::string& value, const std::string& values) {
  throw OptionError(fmt::format("option {} = '{}': must be {}", name, value, values));
}

template <class T>
OptionEntry number(std::string_view name, T& field, const Range<T>& range, std::string_view help) {
  const std::string values = describe(range);
  return {name, values, help, [&field] { return fmt::format("{}", field); },
          [&field, name, range, values](const std::string& text) {
            const std::optional<T> x = parse<T>(text);
            if (!x || !range.contains(*x)) fail(name, text, values);
            field = *x;
          }};
}

/// A number, or none by the word auto.
template <class T>
OptionEntry number_or_auto(std::string_view name, std::optional<T>& field, const Range<T>& range,
                           std::string_view help) {
  const std::string values = "auto or " + describe(range);
  return {name, values, help, [&field] { return field ? fmt::format("{}", *field) : "auto"; },
          [&field, name, range, values](const std::string& text) {
            const std::optional<T> x = parse<T>(text);
            if (text != "auto" && (!x || !range.contains(*x))) fail(name, text, values);
            field = x;
          }};
}

/// `words[i]` names the enumerator of value i; those without a word are not valid.
template <class Enum, std::size_t N>
OptionEntry choice(std::string_view name, Enum& field, const std::array<std::string_view, N>& words,
                   std::string_view help) {
  const std::string values = fmt::format("{}", fmt::join(words, "|"));
  return {name, values, help,
          [&field, name, words, values] {
            const auto index = static_cast<std::size_t>(field);
            if (index >= N) fail(name, std::to_string(index), values);
            return std::string(words.at(index));
          },
          [&field, name, words, values](const std::string& text) {
            const auto* word = std::find(words.begin(), words.end(), text);
            if (word == words.end()) fail(name, text, values);
            field = static_cast<Enum>(word - words.begin());
          }};
}

constexpr std::array<std::string_view, 2> kPhaseSpaces{"directions", "bidirectional"};

OptionEntry max_depth(int& field) {
  return number("max_depth", field, Range<int>{1, kMaxPathLength}, "longest path, in edges");
}

// Of all integrators with chains.
OptionEntry direct(DirectLight& field) {
  return choice("direct", field, std::array<std::string_view, 2>{"chain", "apart"},
                "paths of 1 and 2 edges: by the chains, or by a path tracer in a pass of its own");
}
OptionEntry chains(int& field) {
  return number("chains", field, Range<int>{1, 1000000},
                "independent chains; the image depends on it, not on the threads");
}
OptionEntry bootstrap(int& field) {
  return number("bootstrap", field, Range<int>{1, 1000000000},
                "samples that find the mean brightness and start the chains");
}

OptionEntry target_acceptance(double& field) {
  return number(
      "target_acceptance", field, Range<double>{0, 1},
      "a pilot tunes the scale until so many small steps are accepted; 0: it is as given");
}

/// Every value must survive its own text form, which `set` checks.
void check(const std::vector<OptionEntry>& entries) {
  for (const OptionEntry& entry : entries) entry.set(entry.get());
}

void append(std::vector<OptionEntry>& to, const std::vector<OptionEntry>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

/// The same options, which do nothing unless the setting `text` is made.
std::vector<OptionEntry> only_with(std::string_view text, const std::function<bool()>& holds,
                                   std::vector<OptionEntry> entries) {
  for (OptionEntry& entry : entries)
    if (!entry.condition) entry.condition = {text, holds};
  return entries;
}

/// `scale` is the help of the second step's size.
std::vector<OptionEntry> delayed_rejection_entries(
    DelayedRejection& options,
    std::string_view scale = "scale of that second step, over that of the first") {
  std::vector<OptionEntry> result{
      choice("delayed_rejection", options.on, std::array<std::string_view, 2>{"off", "on"},
             "a rejected small step is followed by a second, smaller one")};
  append(result, only_with("delayed_rejection=on", [&options] { return options.on; },
                           {number("second_scale", options.second_scale,
                                   Range<double>{.low = 0, .open = true}, scale)}));
  return result;
}

std::vector<OptionEntry> chain_entries(LangevinOptions& options) {
  return {
      number_or_auto("large_step_probability", options.large_step_probability, Range<double>{0, 1},
                     "probability of an independent proposal; auto: from the bootstrap"),
      choice("large_steps", options.large_steps, std::array<std::string_view, 2>{"path", "bdpt"},
             "where independent proposals come from: the sensor, or both ends"),
      target_acceptance(options.target_acceptance),
      direct(options.direct),
      chains(options.chains),
      bootstrap(options.bootstrap)};
}

std::vector<OptionEntry> redistribution_entries(RedistributionOptions& options) {
  const Range<double> positive{.low = 0, .open = true};
  return {
      number_or_auto("threshold", options.threshold, positive,
                     "samples keep so many times the local brightness; auto: from a pilot"),
      number("chain_length", options.chain_length, Range<int>{1, 1000000}, "mutations of a chain"),
      number_or_auto("mutations_per_sample", options.mutations_per_sample, positive,
                     "most mutations for each sample, in the mean; auto: from a pilot"),
      number_or_auto("perturbations", options.perturbations, Range<double>{0, 1},
                     "share of the mutations of chains that are perturbations of mlt; auto: from a "
                     "pilot"),
      choice("guide", options.guide, std::array<std::string_view, 2>{"off", "on"},
             "light subpaths start where a pilot has found that light comes from"),
      number_or_auto("light_subpaths", options.light_subpaths, Range<double>{0, 1, true},
                     "light subpaths for each sample, in the mean; auto: from a pilot"),
      number("pilot", options.pilot, Range<int>{256, 1000000000},
             "samples of the pilot's last round"),
  };
}

std::vector<OptionEntry> splitting_entries(SplittingOptions& options) {
  return {
      choice("split", options.all, std::array<std::string_view, 2>{"auto", "all"},
             "particles carry what a pilot finds them better for, or all that samples leave"),
      number_or_auto("levels", options.levels, Range<int>{0, 32},
                     "softer versions of the scene; 0: none, auto: as it needs"),
      number_or_auto("level_steps", options.steps, Range<int>{0, 1000000},
                     "steps of a particle at each softer level; auto: 4, or 16 where narrow lobes "
                     "are softened"),
      number("level_scale", options.scale, Range<double>{.low = 0, .open = true},
             "scale of those steps, over that of all others"),
      number("level_trust", options.trust, Range<double>{.low = 0, .open = true},
             "trust of the steps of particles"),
      number("last_steps", options.last_steps, Range<int>{1, 1000000},
             "steps of a particle in the scene itself"),
      number_or_auto("last_perturbations", options.last_perturbations, Range<double>{0, 1},
                     "share of those steps that are perturbations of mlt; auto: 1 with a pinhole, "
                     "else 0"),
      number("splitting_pilot", options.pilot, Range<int>{64, 1000000000},
             "samples of each round of the pilot that finds what particles are worth"),
  };
}

/// The sizes of a Langevin step; `trust` is the help of that option.
std::vector<OptionEntry> step_size_entries(KernelOptions& kernel, std::string_view trust) {
  const Range<double> positive{.low = 0, .open = true};
  return {number("epsilon", kernel.epsilon, positive, "bound of dt |(a, grad U)|"),
          number("safety", kernel.safety, positive, "divisor of the time step"),
          number("time_step_cap", kernel.time_step_cap, positive, "largest time step"),
          number("scale", kernel.scale, positive, "factor on the step matrix T"),
          number("scale_decades", kernel.scale_decades, Range<double>{0, 10},
                 "decades over which each step draws its scale; 0: fixed"),
          number("trust", kernel.trust, positive, trust)};
}

}  // namespace

std::vector<OptionEntry> entries(LangevinOptions& options) {
  constexpr std::array<std::string_view, 3> kDrifts{"none", "gradient", "full"};
  constexpr std::array<std::string_view, 4> kPreconditioners{"identity", "diagonal", "constraints",
                                                             "hessian"};
  constexpr std::array<std::string_view, 2> kMethods{"jet", "hand"};
  KernelOptions& kernel = options.kernel;
  std::vector<OptionEntry> result{
      choice(
          "mode", options.mode,
          std::array<std::string_view, 3>{"chain", "redistribution", "splitting"},
          "who carries light: chains; samples whose rare heavy ones chains spread; or these, and "
          "particles that softer versions of the scene lead to what is too rare"),
      choice("phase_space", options.phase_space, kPhaseSpaces,
             "coordinates of a path: directions from the sensor, or from both ends"),
      choice("drift", kernel.drift, kDrifts,
             "drift of a small step: Brownian, -T T* grad U, or that + div(T T*)"),
      choice("preconditioner", kernel.preconditioner, kPreconditioners,
             "step matrix: the same in all directions, from the diagonal or the whole matrix of "
             "the path's constraints, or from second derivatives of the contribution"),
      choice("derivatives", kernel.derivatives, kMethods,
             "automatic or hand-derived derivatives; the same to rounding"),
      choice("aperture", kernel.aperture, std::array<std::string_view, 2>{"off", "on"},
             "constraints feel the edges of holes and gaps, by probe rays about each segment"),
  };
  append(result, step_size_entries(kernel,
                                   "radius, in radians, beyond which a step is not to go where "
                                   "constraints allow it"));
  append(result, delayed_rejection_entries(options.delayed_rejection));
  append(result, only_with(
                     "mode=chain", [&options] { return options.mode == Mode::Chain; },
                     chain_entries(options)));
  append(result,
         only_with(
             "mode=redistribution or splitting", [&options] { return options.mode != Mode::Chain; },
             redistribution_entries(options.redistribution)));
  append(result, only_with(
                     "mode=splitting", [&options] { return options.mode == Mode::Splitting; },
                     splitting_entries(options.splitting)));
  result.push_back(max_depth(options.max_depth));
  return result;
}

std::vector<OptionEntry> entries(PathOptions& options) { return {max_depth(options.max_depth)}; }

std::vector<OptionEntry> entries(BdptOptions& options) {
  constexpr std::array<std::string_view, 2> kHeuristics{"balance", "power"};
  return {
      choice("heuristic", options.heuristic, kHeuristics,
             "how strategies share a path: by their densities, or by the squares of these"),
      max_depth(options.max_depth),
  };
}

std::vector<OptionEntry> entries(LightOptions& options) { return {max_depth(options.max_depth)}; }

std::vector<OptionEntry> entries(PrimaryOptions& options) {
  const Range<double> size{.low = 0, .high = 1, .open = true};
  std::vector<OptionEntry> result{
      number("large_step_probability", options.large_step_probability, Range<double>{0, 1},
             "probability of drawing all numbers anew"),
      number("step_min", options.step_min, size, "least size of a small step, at most step_max"),
      number("step_max", options.step_max, size, "largest size of a small step"),
  };
  append(result, delayed_rejection_entries(
                     options.delayed_rejection,
                     "scale of that second step, over that of steps from step_min to step_max"));
  append(result, {direct(options.direct), chains(options.chains), bootstrap(options.bootstrap),
                  max_depth(options.max_depth)});
  return result;
}

std::vector<OptionEntry> entries(MmltOptions& options) {
  std::vector<OptionEntry> result = entries(static_cast<PrimaryOptions&>(options));
  result.insert(
      result.begin() + 1,
      choice("large_steps", options.large_steps, std::array<std::string_view, 2>{"one", "all"},
             "proposals drawn anew: of one strategy, or a whole bidirectional sample, of "
             "which one path goes on"));
  return result;
}

namespace {

/// Those of MMLT, and behind its own `more`.
std::vector<OptionEntry> gaussian_step_entries(GaussianStepOptions& options,
                                               std::vector<OptionEntry> more) {
  std::vector<OptionEntry> result = entries(static_cast<MmltOptions&>(options));
  more.insert(more.begin(),
              number("isotropic_probability", options.isotropic_probability, Range<double>{0, 1},
                     "share of the small steps that are those of mmlt"));
  result.insert(result.begin() + 2, more.begin(), more.end());
  return result;
}

OptionEntry sigma_entry(double& sigma) {
  return number("sigma", sigma, Range<double>{.low = 0, .high = 1, .open = true},
                "standard deviation of the isotropic prior of a small step");
}

}  // namespace

std::vector<OptionEntry> entries(H2mcOptions& options) {
  return gaussian_step_entries(options, {sigma_entry(options.sigma)});
}

std::vector<OptionEntry> entries(LmcOptions& options) {
  return gaussian_step_entries(
      options,
      {number("step", options.step, Range<double>{.low = 0, .high = 10, .open = true}, "time step"),
       sigma_entry(options.sigma),
       number("gradient_bound", options.gradient_bound,
              Range<double>{.low = 0, .high = 1e9, .open = true},
              "length to which longer gradients are cut"),
       number("momentum", options.momentum, Range<double>{0, 1},
              "weight of former gradients in the drift at first"),
       number("locality", options.locality, Range<double>{0, 1},
              "weight of the current gradient in the preconditioner"),
       number("adaptation_decay", options.adaptation_decay,
              Range<double>{.low = 0, .high = 1, .open = true},
              "the t-th gradient weighs t^-adaptation_decay among former ones"),
       number("cache", options.cache, Range<int>{0, 1000000},
              "points of a strategy at which a pilot remembers gradients for all steps; 0: chains "
              "do, as they go")});
}

std::vector<OptionEntry> entries(MalaOptions& options) {
  KernelOptions& kernel = options.kernel;
  std::vector<OptionEntry> result = gaussian_step_entries(
      options,
      {choice("drift", kernel.drift, std::array<std::string_view, 2>{"none", "gradient"},
              "drift of a small step: Brownian, or -T T* grad U"),
       choice("preconditioner", kernel.preconditioner,
              std::array<std::string_view, 3>{"identity", "diagonal", "constraints"},
              "step matrix: the same in all numbers, or from the diagonal or the whole matrix of "
              "the path's constraints")});
  const std::vector<OptionEntry> sizes = step_size_entries(
      kernel,
      "radius, in halves of a number's range, beyond which a step is not to go where "
      "constraints allow it");
  result.insert(result.begin() + 5, sizes.begin(), sizes.end());
  result.insert(result.begin() + 5, target_acceptance(options.target_acceptance));
  return result;
}

namespace {

/// Those of the perturbations, behind the `first` and before the `last`.
std::vector<OptionEntry> perturbation_entries(PerturbationOptions& options,
                                              std::vector<OptionEntry> first,
                                              const std::vector<OptionEntry>& last) {
  const Range<double> size{.low = 0, .high = 1, .open = true};
  first.push_back(
      number("manifold_probability", options.manifold_probability, Range<double>{0, 1},
             "share of the perturbations that find the smooth and narrow vertices beside "
             "one that moves again, where there are any"));
  first.push_back(number("step_min", options.step_min, size,
                         "least step of a perturbation, in widths of the film, at most step_max"));
  first.push_back(number("step_max", options.step_max, size, "largest step of a perturbation"));
  append(first, delayed_rejection_entries(options.delayed_rejection));
  first.push_back(direct(options.direct));
  first.insert(first.end(), last.begin(), last.end());
  first.push_back(max_depth(options.max_depth));
  return first;
}

void check_steps(double step_min, double step_max) {
  if (step_min > step_max)
    throw OptionError(
        fmt::format("option step_min = '{}': must be at most step_max = {}", step_min, step_max));
}

}  // namespace

std::vector<OptionEntry> entries(MltOptions& options) {
  return perturbation_entries(
      options,
      {number("bidirectional_probability", options.bidirectional_probability, Range<double>{0, 1},
              "probability of a bidirectional mutation; the others are perturbations")},
      {chains(options.chains), bootstrap(options.bootstrap)});
}

std::vector<OptionEntry> entries(ErptOptions& options) {
  return perturbation_entries(
      options,
      {number("chain_length", options.chain_length, Range<int>{1, 1000000}, "mutations of a chain"),
       number("mutations_per_sample", options.mutations_per_sample,
              Range<double>{.low = 0, .open = true}, "mutations for each sample, in the mean")},
      {number("pilot", options.pilot, Range<int>{256, 1000000000},
              "samples that find how much light each mutation deposits")});
}

std::string_view name_of(PhaseSpace phase_space) {
  return kPhaseSpaces.at(static_cast<std::size_t>(phase_space));
}

void LangevinOptions::validate() const {
  LangevinOptions copy = *this;
  check(entries(copy));
}

void PathOptions::validate() const {
  PathOptions copy = *this;
  check(entries(copy));
}

void BdptOptions::validate() const {
  BdptOptions copy = *this;
  check(entries(copy));
}

void LightOptions::validate() const {
  LightOptions copy = *this;
  check(entries(copy));
}

void PrimaryOptions::validate() const {
  PrimaryOptions copy = *this;
  check(entries(copy));
  check_steps(step_min, step_max);
}

void MmltOptions::validate() const {
  PrimaryOptions::validate();
  MmltOptions copy = *this;
  check(entries(copy));
}

void H2mcOptions::validate() const {
  PrimaryOptions::validate();
  H2mcOptions copy = *this;
  check(entries(copy));
}

void LmcOptions::validate() const {
  PrimaryOptions::validate();
  LmcOptions copy = *this;
  check(entries(copy));
}

void MalaOptions::validate() const {
  PrimaryOptions::validate();
  MalaOptions copy = *this;
  check(entries(copy));
}

void MltOptions::validate() const {
  MltOptions copy = *this;
  check(entries(copy));
  check_steps(step_min, step_max);
}

void ErptOptions::validate() const {
  ErptOptions copy = *this;
  check(entries(copy));
  check_steps(step_min, step_max);
}

void set_option(const std::vector<OptionEntry>& entries, const std::string& name,
                const std::string& value) {
  std::vector<std::string_view> names;
  for (const OptionEntry& entry : entries) {
    if (entry.name == name) return entry.set(value);
    names.push_back(entry.name);
  }
  throw OptionError(
      fmt::format("unknown option '{}'; the options are {}", name, fmt::join(names, ", ")));
}

void check_condition(const std::vector<OptionEntry>& entries, const std::string& name) {
  for (const OptionEntry& entry : entries)
    if (entry.name == name && entry.condition && !entry.condition->holds())
      throw OptionError(
          fmt::format("option {} does nothing without {}", name, entry.condition->text));
}

}  // namespace driftlight
