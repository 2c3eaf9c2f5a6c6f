// SPDX-License-Identifier: Apache-2.0
/// Options: their text form, their bounds, and what errors say.
#include "driftlight/options.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "driftlight/error.h"

namespace driftlight {
namespace {

const OptionEntry& find(const std::vector<OptionEntry>& entries, const std::string& name) {
  for (const OptionEntry& entry : entries)
    if (entry.name == name) return entry;
  throw std::logic_error("no option " + name);
}

/// Message of the OptionError that `action` throws; empty if it throws none.
template <class Action>
std::string option_error(const Action& action) {
  try {
    action();
  } catch (const OptionError& error) {
    return error.what();
  }
  return "";
}

TEST(Options, EveryDefaultIsValid) {
  EXPECT_NO_THROW(LangevinOptions().validate());
  EXPECT_NO_THROW(PathOptions().validate());
}

TEST(Options, EveryEntryHasTextAndSurvivesIt) {
  LangevinOptions options;
  for (const OptionEntry& entry : entries(options)) {
    EXPECT_FALSE(entry.values.empty()) << entry.name;
    EXPECT_FALSE(entry.help.empty()) << entry.name;
    const std::string text = entry.get();
    entry.set(text);
    EXPECT_EQ(entry.get(), text) << entry.name;
  }
  // 1/3 has no short decimal form, but its text is exact.
  EXPECT_EQ(options.kernel.time_step_cap, 1.0 / 3.0);
}

// Law: an option that does nothing in the mode, or without another one, says what it needs.
TEST(Options, ConditionsFollowTheOtherOptions) {
  LangevinOptions options;
  const auto list = entries(options);
  const auto error = [&](const std::string& name) {
    return option_error([&] { check_condition(list, name); });
  };
  EXPECT_EQ(error("chains"), "option chains does nothing without mode=chain");
  EXPECT_EQ(error("levels"), "");
  EXPECT_EQ(error("threshold"), "");
  EXPECT_EQ(error("drift"), "");
  options.mode = Mode::Redistribution;
  EXPECT_EQ(error("levels"), "option levels does nothing without mode=splitting");
  EXPECT_EQ(error("threshold"), "");
  options.mode = Mode::Chain;
  EXPECT_EQ(error("chains"), "");
  EXPECT_EQ(error("threshold"),
            "option threshold does nothing without mode=redistribution or splitting");
  EXPECT_EQ(error("second_scale"), "option second_scale does nothing without delayed_rejection=on");
  options.delayed_rejection.on = true;
  EXPECT_EQ(error("second_scale"), "");
}

TEST(Options, SetReachesTheFields) {
  LangevinOptions options;
  const auto list = entries(options);
  for (const auto& [text, drift] :
       {std::pair("none", Drift::None), {"gradient", Drift::Gradient}, {"full", Drift::Full}}) {
    set_option(list, "drift", text);
    EXPECT_EQ(options.kernel.drift, drift);
    EXPECT_EQ(find(list, "drift").get(), text);
  }
  set_option(list, "preconditioner", "identity");
  EXPECT_EQ(options.kernel.preconditioner, PreconditionerKind::Identity);
  set_option(list, "preconditioner", "constraints");
  EXPECT_EQ(options.kernel.preconditioner, PreconditionerKind::Constraints);
  set_option(list, "aperture", "on");
  EXPECT_TRUE(options.kernel.aperture);
  set_option(list, "aperture", "off");
  EXPECT_FALSE(options.kernel.aperture);
  set_option(list, "epsilon", "0.25");
  set_option(list, "safety", "10");
  set_option(list, "time_step_cap", "1e-2");
  set_option(list, "scale", ".5");
  set_option(list, "scale_decades", "2");
  EXPECT_EQ(find(list, "large_step_probability").get(), "auto");
  set_option(list, "large_step_probability", "0");
  EXPECT_EQ(find(list, "light_subpaths").get(), "auto");
  set_option(list, "light_subpaths", "0.25");
  set_option(list, "chains", "7");
  set_option(list, "bootstrap", "1000");
  set_option(list, "max_depth", "16");
  EXPECT_EQ(options.kernel.epsilon, 0.25);
  EXPECT_EQ(options.kernel.safety, 10.0);
  EXPECT_EQ(options.kernel.time_step_cap, 0.01);
  EXPECT_EQ(options.kernel.scale, 0.5);
  EXPECT_EQ(options.kernel.scale_decades, 2.0);
  EXPECT_EQ(options.large_step_probability, 0.0);
  EXPECT_EQ(options.redistribution.light_subpaths, 0.25);
  EXPECT_EQ(options.chains, 7);
  EXPECT_EQ(options.bootstrap, 1000);
  EXPECT_EQ(options.max_depth, kMaxPathLength);
  PathOptions path;
  set_option(entries(path), "max_depth", "3");
  EXPECT_EQ(path.max_depth, 3);
}

struct BadValue {
  const char* name;
  const char* value;
};

class BadOption : public ::testing::TestWithParam<BadValue> {};

TEST_P(BadOption, IsRefusedWithNameValueAndBound) {
  LangevinOptions options;
  const auto list = entries(options);
  const std::string name = GetParam().name;
  const std::string value = GetParam().value;
  const std::string before = find(list, name).get();
  const std::string message = option_error([&] { set_option(list, name, value); });
  EXPECT_NE(message.find(name), std::string::npos) << message;
  EXPECT_NE(message.find("'" + value + "'"), std::string::npos) << message;
  EXPECT_NE(message.find(find(list, name).values), std::string::npos) << message;
  EXPECT_EQ(find(list, name).get(), before);
}

INSTANTIATE_TEST_SUITE_P(
    Options, BadOption,
    ::testing::Values(
        BadValue{"drift", "sideways"}, BadValue{"drift", ""}, BadValue{"drift", "Full"},
        BadValue{"preconditioner", "newton"}, BadValue{"aperture", "1"}, BadValue{"epsilon", "0"},
        BadValue{"epsilon", "-1"}, BadValue{"epsilon", "nan"}, BadValue{"epsilon", "inf"},
        BadValue{"epsilon", "0.1x"}, BadValue{"epsilon", " 0.1"}, BadValue{"epsilon", ""},
        BadValue{"epsilon", "1e999"}, BadValue{"safety", "0"}, BadValue{"time_step_cap", "0"},
        BadValue{"scale", "-0.5"}, BadValue{"scale_decades", "-1"}, BadValue{"scale_decades", "11"},
        BadValue{"large_step_probability", "1.01"}, BadValue{"large_step_probability", "-0.01"},
        BadValue{"light_subpaths", "0"}, BadValue{"light_subpaths", "1.5"}, BadValue{"chains", "0"},
        BadValue{"chains", "1.5"}, BadValue{"chains", "1e3"}, BadValue{"bootstrap", "0"},
        BadValue{"bootstrap", "99999999999999"}, BadValue{"max_depth", "0"},
        BadValue{"max_depth", "17"}, BadValue{"max_depth", "0x4"}));

TEST(Options, AnUnknownNameIsRefusedWithTheValidOnes) {
  LangevinOptions options;
  const std::string message = option_error([&] { set_option(entries(options), "epsilom", "0.1"); });
  EXPECT_NE(message.find("'epsilom'"), std::string::npos) << message;
  for (const OptionEntry& entry : entries(options))
    EXPECT_NE(message.find(entry.name), std::string::npos) << message;
}

TEST(Options, ValidateChecksFieldsThatWereSetDirectly) {
  LangevinOptions options;
  options.kernel.epsilon = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(option_error([&] { options.validate(); }).find("epsilon"), std::string::npos);
  options = {};
  options.kernel.scale = std::numeric_limits<double>::infinity();
  EXPECT_NE(option_error([&] { options.validate(); }).find("scale"), std::string::npos);
  options = {};
  options.chains = -3;
  EXPECT_NE(option_error([&] { options.validate(); }).find("'-3'"), std::string::npos);
  options = {};
  options.max_depth = kMaxPathLength + 1;
  EXPECT_NE(option_error([&] { options.validate(); }).find("[1, 16]"), std::string::npos);
  PathOptions path;
  path.max_depth = 0;
  EXPECT_NE(option_error([&] { path.validate(); }).find("max_depth"), std::string::npos);
}

}  // namespace
}  // namespace driftlight
