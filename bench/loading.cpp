// SPDX-License-Identifier: Apache-2.0
/// What loading a large mesh costs, by format: the time of load_scene over that of reading the
/// bytes (of serialized files, inflating them) and building Embree's tree of the same mesh, and the
/// peak of memory a triangle without Embree's own. `bench_loading [MILLIONS OF TRIANGLES]`, 3 by
/// default. Each figure is of 15 processes that do nothing else, since peaks do not go down, and
/// memory is slow the first time that it is touched: the fastest of them, as what disturbs only
/// adds, and Embree's build alone takes from 0.7 to 1.4 s from one to the next; and the median.
#include <embree3/rtcore.h>
#include <fmt/core.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "driftlight/scene_file.h"

namespace driftlight {
namespace {

double seconds(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Peak of the process's memory, in bytes.
double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

/// A wavy square of 2 n^2 triangles.
TriangleMesh waves(std::uint32_t n) {
  TriangleMesh mesh;
  for (std::uint32_t y = 0; y <= n; ++y)
    for (std::uint32_t x = 0; x <= n; ++x) {
      const float u = 2.0F * static_cast<float>(x) / static_cast<float>(n) - 1.0F;
      const float v = 2.0F * static_cast<float>(y) / static_cast<float>(n) - 1.0F;
      mesh.positions.emplace_back(u, v, 0.05F * std::sin(20.0F * u) * std::sin(17.0F * v));
    }
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t i = y * (n + 1) + x;
      mesh.triangles.push_back({i, i + 1, i + n + 2});
      mesh.triangles.push_back({i, i + n + 2, i + n + 1});
    }
  return mesh;
}

template <class T>
void append(std::string& bytes, const T& value) {
  const auto* data = reinterpret_cast<const char*>(&value);
  bytes.append(data, sizeof value);
}

std::string ply(const TriangleMesh& mesh) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n"
      "property float y\nproperty float z\nelement face {}\n"
      "property list uchar int vertex_indices\nend_header\n",
      mesh.positions.size(), mesh.triangles.size());
  for (const Eigen::Vector3f& p : mesh.positions)
    for (int i = 0; i < 3; ++i) append(bytes, p[i]);
  for (const auto& triangle : mesh.triangles) {
    bytes.push_back(3);
    for (const std::uint32_t i : triangle) append(bytes, i);
  }
  return bytes;
}

std::string obj(const TriangleMesh& mesh) {
  std::string bytes;
  for (const Eigen::Vector3f& p : mesh.positions)
    bytes += fmt::format("v {} {} {}\n", p.x(), p.y(), p.z());
  for (const auto& t : mesh.triangles)
    bytes += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return bytes;
}

std::string serialized(const TriangleMesh& mesh) {
  std::string data;
  append(data, std::uint32_t{0x1000});  // single precision
  data.push_back('\0');                 // no name
  append(data, std::uint64_t{mesh.positions.size()});
  append(data, std::uint64_t{mesh.triangles.size()});
  for (const Eigen::Vector3f& p : mesh.positions)
    for (int i = 0; i < 3; ++i) append(data, p[i]);
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t i : triangle) append(data, i);
  uLongf size = compressBound(data.size());
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(data.data()), data.size());
  packed.resize(size);
  std::string bytes;
  append(bytes, std::uint16_t{0x041C});
  append(bytes, std::uint16_t{4});
  bytes += packed;
  append(bytes, std::uint64_t{0});  // where the one mesh begins
  append(bytes, std::uint32_t{1});
  return bytes;
}

std::string read_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes(std::filesystem::file_size(file), '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return bytes;
}

void read_raw(const std::filesystem::path& file, std::size_t inflated_size) {
  const std::string bytes = read_bytes(file);
  if (file.extension() != ".serialized") return;
  std::string data(inflated_size, '\0');
  uLongf size = data.size();
  uncompress(reinterpret_cast<Bytef*>(data.data()), &size,
             reinterpret_cast<const Bytef*>(bytes.data()) + 4, bytes.size() - 4);
}

/// As Scene builds it.
double build_tree(const TriangleMesh& mesh, std::atomic<long long>& bytes) {
  return seconds([&] {
    RTCDevice device = rtcNewDevice("threads=0,set_affinity=0");
    rtcSetDeviceMemoryMonitorFunction(
        device,
        [](void* sum, ssize_t size, bool) {
          *static_cast<std::atomic<long long>*>(sum) += size;
          return true;
        },
        &bytes);
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                             3 * sizeof(float), mesh.positions.size());
    std::memcpy(vertices, mesh.positions.data(), 3 * sizeof(float) * mesh.positions.size());
    void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            3 * sizeof(std::uint32_t), mesh.triangles.size());
    std::memcpy(indices, mesh.triangles.data(), 3 * sizeof(std::uint32_t) * mesh.triangles.size());
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    // Left to the end of the process, as what is released counts against the sum.
  });
}

/// What `work` returns in a process of its own; none if it fails.
template <class Figures>
std::optional<Figures> in_process(const std::function<Figures()>& work) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) return std::nullopt;
  const pid_t child = fork();
  if (child == 0) {
    const Figures figures = work();
    _exit(write(ends[1], &figures, sizeof figures) == sizeof figures ? 0 : 1);
  }
  close(ends[1]);
  Figures figures;
  const bool complete = read(ends[0], &figures, sizeof figures) == sizeof figures;
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return complete ? std::optional(figures) : std::nullopt;
}

struct Load {
  double seconds, peak;
};
Load load(const std::filesystem::path& scene_file) {
  const double before = peak_memory();
  std::optional<LoadedScene> loaded;
  const double taken = seconds([&] { loaded.emplace(load_scene(scene_file)); });
  return {taken, peak_memory() - before};
}

struct Baseline {
  double raw, build, embree_bytes;
};
Baseline baseline(const std::filesystem::path& file, std::size_t inflated_size,
                  const TriangleMesh& mesh) {
  const double raw = seconds([&] { read_raw(file, inflated_size); });
  std::atomic<long long> bytes{0};
  const double build = build_tree(mesh, bytes);
  return {raw, build, static_cast<double>(bytes)};
}

/// Of each figure that which is larger than so large a part of them.
template <class Figures>
Figures quantile(const std::vector<Figures>& all, double part) {
  constexpr std::size_t kCount = sizeof(Figures) / sizeof(double);
  std::array<double, kCount> result{};
  for (std::size_t k = 0; k < kCount; ++k) {
    std::vector<double> values;
    for (const Figures& figures : all)
      values.push_back(std::bit_cast<std::array<double, kCount>>(figures)[k]);
    std::sort(values.begin(), values.end());
    result[k] = values[static_cast<std::size_t>(part * static_cast<double>(values.size()))];
  }
  return std::bit_cast<Figures>(result);
}

void measure(const std::string& format, const std::filesystem::path& file,
             std::size_t inflated_size, const TriangleMesh& mesh) {
  const auto scene_file = file.parent_path() / (format + ".xml");
  std::ofstream(scene_file) << fmt::format(
      R"(<scene version="0.6.0"><sensor type="perspective"><film type="hdrfilm">)"
      R"(<integer name="width" value="16"/><integer name="height" value="16"/>)"
      R"(<rfilter type="box"/></film></sensor><emitter type="constant"/><shape type="{}">)"
      R"(<string name="filename" value="{}"/></shape></scene>)",
      format, file.filename().string());
  std::vector<Load> loads;
  std::vector<Baseline> baselines;
  for (int i = 0; i < 15; ++i) {
    const auto loaded = in_process<Load>([&] { return load(scene_file); });
    const auto base = in_process<Baseline>([&] { return baseline(file, inflated_size, mesh); });
    if (!loaded || !base) return fmt::print("{}: failed\n", format);
    loads.push_back(*loaded);
    baselines.push_back(*base);
  }
  const auto triangles = static_cast<double>(mesh.triangles.size());
  for (const auto& [name, part] : {std::pair{"fastest", 0.0}, std::pair{"median", 0.5}}) {
    const Load l = quantile(loads, part);
    const Baseline b = quantile(baselines, part);
    fmt::print(
        "{:10} {:4.0f} MB  {:7}: raw read {:.3f} s  Embree {:.3f} s  load {:.3f} s, {:.2f} times  "
        "{:.0f} bytes a triangle, {:.0f} of them Embree's in the end\n",
        format, static_cast<double>(std::filesystem::file_size(file)) / 1e6, name, b.raw, b.build,
        l.seconds, l.seconds / (b.raw + b.build), l.peak / triangles, b.embree_bytes / triangles);
  }
}

}  // namespace
}  // namespace driftlight

int main(int argc, char** argv) {
  using namespace driftlight;
  const double millions = argc > 1 ? std::stod(argv[1]) : 3.0;
  const auto n = static_cast<std::uint32_t>(std::sqrt(0.5e6 * millions));
  const auto folder = std::filesystem::temp_directory_path() / "driftlight_bench_loading";
  std::filesystem::create_directories(folder);
  const TriangleMesh mesh = waves(n);
  const std::size_t inflated_size =
      4 + 1 + 16 + 12 * (mesh.positions.size() + mesh.triangles.size());
  using Writer = std::string (*)(const TriangleMesh&);
  const std::vector<std::pair<std::string, Writer>> formats{
      {"ply", &ply}, {"serialized", &serialized}, {"obj", &obj}};
  for (const auto& [format, write] : formats) {
    const auto file = folder / ("waves." + format);
    std::ofstream(file, std::ios::binary) << write(mesh);
    measure(format, file, inflated_size, mesh);
  }
  std::filesystem::remove_all(folder);
  return 0;
}
