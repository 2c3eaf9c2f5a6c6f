// SPDX-License-Identifier: Apache-2.0
/// Scenes that tests write themselves.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>

#include "driftlight/error.h"
#include "driftlight/scene_file.h"

namespace driftlight::test {

/// A directory for the files of one test in one process, removed afterwards.
class SceneDirectory {
 public:
  SceneDirectory() {
    static std::atomic<int> count{0};
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = "driftlight_" + std::to_string(::getpid()) + "_" + info->test_suite_name() +
                       "_" + info->name() + "_";
    for (char& c : name)
      if (c == '/') c = '_';
    path_ = std::filesystem::path(::testing::TempDir()) / (name + std::to_string(count++));
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~SceneDirectory() { std::filesystem::remove_all(path_); }
  SceneDirectory(const SceneDirectory&) = delete;
  SceneDirectory& operator=(const SceneDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }

  std::filesystem::path write(const std::string& name, const std::string& content) const {
    std::ofstream(path_ / name, std::ios::binary) << content;
    return path_ / name;
  }

  LoadedScene load(const std::string& content, const LoadOptions& options = {}) const {
    return load_scene(write("scene.xml", content), options);
  }

 private:
  std::filesystem::path path_;
};

inline const std::string kSensor =
    R"(<sensor type="perspective"><float name="fov" value="60"/><film type="hdrfilm">)"
    R"(<integer name="width" value="200"/><integer name="height" value="100"/>)"
    R"(<rfilter type="box"/></film></sensor>)";
inline const std::string kEmitter = R"(<emitter type="constant"/>)";
inline const std::string kShape = R"(<shape type="sphere"/>)";

/// A scene file; `body` begins in line 2, column 1.
inline std::string scene_file(const std::string& body) {
  return "<scene version=\"0.6.0\">\n" + body + "\n</scene>\n";
}

/// A scene of the body and a sensor.
inline std::string with_sensor(const std::string& body) { return scene_file(body + kSensor); }

/// A scene of the body, a sensor and an emitter.
inline std::string lit(const std::string& body) { return with_sensor(body + kEmitter); }

/// A scene of the body, a sensor, an emitter and a shape: complete whatever the body is.
inline std::string complete(const std::string& body) { return lit(body + kShape); }

inline void expect_contains(const std::string& text, const std::string& fragment) {
  EXPECT_NE(text.find(fragment), std::string::npos) << "no \"" << fragment << "\" in: " << text;
}

/// What the error says that this ends in; fails if there is none.
template <class Load>
std::string scene_error(const Load& load) {
  try {
    load();
  } catch (const SceneError& error) {
    return error.what();
  }
  ADD_FAILURE() << "loaded without an error";
  return {};
}

/// For vectors and colours, by their distance.
template <class Vector>
void expect_near(const Vector& actual, const Vector& expected, double tolerance = 1e-6) {
  EXPECT_LE(static_cast<double>((actual - expected).matrix().norm()), tolerance)
      << actual.transpose() << " instead of " << expected.transpose();
}

}  // namespace driftlight::test
