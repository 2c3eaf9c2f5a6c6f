// SPDX-License-Identifier: Apache-2.0
/// What derivatives of a path cost, by method, class of lobes and path length: in ns, and as a
/// ratio to the value of the same paths. Counters: `ratio`, of processor times, and `error`, the
/// median over the paths of |x - reference| / |reference|, in the norm of the widths, with the
/// reference by wide or nested jets. At the end come tables of the ratios; with
/// --benchmark_repetitions the fastest of equal runs counts. Compile times and sizes of the code:
/// derivatives/cost.sh.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "derivatives/paths.h"
#include "derivatives/variants.h"
#include "driftlight/contribution.h"
#include "driftlight/divergence.h"
#include "driftlight/exact_divergence.h"
#include "driftlight/factor.h"

namespace driftlight::bench {
namespace {

// ---- Results ------------------------------------------------------------------------------------

/// ns by class, variant and length, in the order of registration.
class Results {
 public:
  /// Runs of more iterations replace shorter ones; of equal runs the fastest counts.
  void add(const std::string& path_class, const std::string& variant, int length,
           std::int64_t iterations, double ns) {
    Entry& entry = entries_[{path_class, variant, length}];
    if (iterations > entry.iterations)
      entry = {iterations, ns};
    else if (iterations == entry.iterations)
      entry.ns = std::min(entry.ns, ns);
    const std::pair<std::string, std::string> row{path_class, variant};
    if (std::find(rows_.begin(), rows_.end(), row) == rows_.end()) rows_.push_back(row);
  }

  /// 0 if it has not been measured.
  double get(const std::string& path_class, const std::string& variant, int length) const {
    const auto found = entries_.find({path_class, variant, length});
    return found == entries_.end() ? 0.0 : found->second.ns;
  }

  void print() const {
    std::string last;
    for (const auto& [path_class, variant] : rows_) {
      if (path_class != last) print_head(path_class);
      last = path_class;
      std::printf("| %s", variant.c_str());
      for (int n = kMinLength; n <= kMaxLength; ++n) {
        const double value = get(path_class, "value", n);
        const double ns = get(path_class, variant, n);
        if (!(ns > 0.0 && value > 0.0))
          std::printf(" |");
        else if (variant == "value")
          std::printf(" | %.0f ns", ns);
        else
          std::printf(" | %.2f", ns / value);
      }
      std::printf(" |\n");
    }
  }

 private:
  struct Entry {
    std::int64_t iterations = 0;
    double ns = 0;
  };

  static void print_head(const std::string& path_class) {
    std::printf("\n| %s, edges", path_class.c_str());
    for (int n = kMinLength; n <= kMaxLength; ++n) std::printf(" | %d", n);
    std::printf(" |\n| ---");
    for (int n = kMinLength; n <= kMaxLength; ++n) std::printf(" | ---:");
    std::printf(" |\n");
  }

  std::map<std::tuple<std::string, std::string, int>, Entry> entries_;
  std::vector<std::pair<std::string, std::string>> rows_;
};

Results& results() {
  static Results all;
  return all;
}

// ---- Variants -----------------------------------------------------------------------------------

using Work = std::function<void(const Scene&, const PathState&)>;
/// Vector that a variant computes, or its reference.
using Answer = std::function<Vector(const Scene&, const PathState&)>;

struct Variant {
  std::string name;
  Work work;
  Answer answer;     ///< empty: no error is measured
  Answer reference;  ///< of `answer`
};

Vector reference_gradient(const Scene& scene, const PathState& path) {
  Vector gradient;
  gradient_wide(scene, path.topology, path.chart, gradient);
  return gradient;
}

Vector reference_divergence(const Scene& scene, const PathState& path) {
  return exact_divergence(scene, path.topology, path.chart);
}

Variant gradient_variant(const std::string& name, GradientFunction& function) {
  const auto answer = [&function](const Scene& scene, const PathState& path) {
    Vector gradient;
    function(scene, path.topology, path.chart, gradient);
    return gradient;
  };
  const Work work = [&function, gradient = Vector()](const Scene& scene,
                                                     const PathState& path) mutable {
    function(scene, path.topology, path.chart, gradient);
    benchmark::DoNotOptimize(gradient.data());
    benchmark::ClobberMemory();
  };
  return {"gradient/" + name, work, answer, reference_gradient};
}

using LinearizeFunction = void(const Scene&, const PathTopology&, const Chart&,
                               const DerivativeRequest&, Linearization&);

Variant stage_variant(const std::string& name, LinearizeFunction& function,
                      const DerivativeRequest& request) {
  const auto result = std::make_shared<Linearization>();
  const Work work = [=, &function](const Scene& scene, const PathState& path) {
    function(scene, path.topology, path.chart, request, *result);
    benchmark::DoNotOptimize(result.get());
    benchmark::ClobberMemory();
  };
  const Answer answer = [=](const Scene& scene, const PathState& path) {
    work(scene, path);
    return result->gradient;
  };
  return {name, work, answer, reference_gradient};
}

using DenseFunction = std::function<void(const Scene&, const PathState&, PathDerivatives&)>;

Variant dense_variant(const std::string& name, const DenseFunction& function) {
  const auto result = std::make_shared<PathDerivatives>();
  const Work work = [=](const Scene& scene, const PathState& path) {
    function(scene, path, *result);
    benchmark::DoNotOptimize(result.get());
    benchmark::ClobberMemory();
  };
  const Answer answer = [=](const Scene& scene, const PathState& path) {
    work(scene, path);
    return result->gradient;
  };
  return {name, work, answer, reference_gradient};
}

Variant divergence_variant(const std::string& name, const Answer& function) {
  const Work work = [=](const Scene& scene, const PathState& path) {
    benchmark::DoNotOptimize(function(scene, path));
  };
  return {"divergence/" + name, work, function, reference_divergence};
}

Variant value_variant() {
  return {"value",
          [](const Scene& scene, const PathState& path) {
            benchmark::DoNotOptimize(contribution(scene, path.topology, path.coordinates));
          },
          {},
          {}};
}

Variant riccati_variant() {
  return {"factor/riccati",
          [](const Scene&, const PathState& path) {
            benchmark::DoNotOptimize(RiccatiFactor(path.linearization));
          },
          {},
          {}};
}

/// Of a Q that is given; to form it from the stages is no part of it.
Variant cholesky_variant() {
  const auto known = std::make_shared<std::map<const PathState*, Matrix>>();
  return {"factor/cholesky",
          [=](const Scene&, const PathState& path) {
            Matrix& q = (*known)[&path];
            if (q.size() == 0) q = constraint_matrix(path.linearization);
            benchmark::DoNotOptimize(CholeskyFactor::of(q));
          },
          {},
          {}};
}

std::vector<Variant> variants() {
  const DerivativeRequest gradient{.gradient = true, .constraints = false};
  return {
      value_variant(),
      gradient_variant("wide", gradient_wide),
      gradient_variant("stride 4", gradient_stride4),
      gradient_variant("stride 8", gradient_stride8),
      gradient_variant("wide, float", gradient_wide_float),
      gradient_variant("stride 4, float", gradient_stride4_float),
      gradient_variant("stride 8, float", gradient_stride8_float),
      gradient_variant("central differences", gradient_differences),
      stage_variant("gradient/stage jets", linearize_by_jets, gradient),
      stage_variant("gradient/by hand", linearize_by_hand, gradient),
      dense_variant("gradient + Q/wide",
                    [](const Scene& scene, const PathState& path, PathDerivatives& result) {
                      gradient_q_wide(scene, path.topology, path.chart, result);
                    }),
      dense_variant("gradient + Q/stride 8",
                    [](const Scene& scene, const PathState& path, PathDerivatives& result) {
                      differentiate(scene, path.topology, path.chart, {}, result);
                    }),
      stage_variant("gradient + Q/stage jets", linearize_by_jets, {}),
      stage_variant("gradient + Q/by hand", linearize_by_hand, {}),
      cholesky_variant(),
      riccati_variant(),
      divergence_variant("differences by stage jets",
                         [](const Scene& scene, const PathState& path) {
                           return divergence(scene, path.topology, path.chart,
                                             DerivativeMethod::Jet);
                         }),
      divergence_variant("differences by hand",
                         [](const Scene& scene, const PathState& path) {
                           return divergence(scene, path.topology, path.chart,
                                             DerivativeMethod::Hand);
                         }),
      divergence_variant("nested jets", reference_divergence),
  };
}

// ---- Measurement --------------------------------------------------------------------------------

/// Errors of gradients are scaled by the widths that the constraints leave, |D^-1/2 x|, D = diag Q;
/// those of the divergence, which is a displacement, by |D^1/2 x|.
double median_error(const Scene& scene, const std::vector<PathState>& paths,
                    const Variant& variant) {
  const bool displacement = variant.name.starts_with("divergence");
  std::vector<double> errors;
  for (const PathState& path : paths) {
    const Vector expected = variant.reference(scene, path);
    const Vector difference = variant.answer(scene, path) - expected;
    Vector scale = constraint_matrix(path.linearization).diagonal().cwiseSqrt();
    if (!displacement) scale = scale.cwiseInverse();
    errors.push_back(difference.cwiseProduct(scale).norm() / expected.cwiseProduct(scale).norm());
  }
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

/// Processor time of this thread: others do not count.
double thread_nanoseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}

void measure(benchmark::State& bench, const PathClass& path_class, const Variant& variant) {
  const auto length = static_cast<std::size_t>(bench.range(0));
  const std::vector<PathState>& paths = path_class.paths[length];
  // Also fills what the variants keep.
  for (const PathState& path : paths) variant.work(path_class.scene, path);
  std::size_t i = 0;
  const double start = thread_nanoseconds();
  for (auto _ : bench) {
    variant.work(path_class.scene, paths[i]);
    i = (i + 1) % paths.size();
  }
  const double ns = (thread_nanoseconds() - start) / static_cast<double>(bench.iterations());
  const int n = static_cast<int>(length);
  results().add(path_class.name, variant.name, n, bench.iterations(), ns);
  const double value = results().get(path_class.name, "value", n);
  if (value > 0.0) bench.counters["ratio"] = ns / value;
  if (variant.answer) {
    static std::map<std::tuple<std::string, std::string, int>, double> known;
    const auto [error, is_new] = known.try_emplace({path_class.name, variant.name, n});
    if (is_new) error->second = median_error(path_class.scene, paths, variant);
    bench.counters["error"] = error->second;
  }
}

void register_all() {
  for (const PathClass& path_class : path_classes())
    for (const Variant& variant : variants())
      benchmark::RegisterBenchmark(
          (path_class.name + "/" + variant.name).c_str(),
          [&path_class, variant](benchmark::State& b) { measure(b, path_class, variant); })
          ->DenseRange(kMinLength, kMaxLength);
}

}  // namespace
}  // namespace driftlight::bench

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  driftlight::bench::register_all();
  benchmark::RunSpecifiedBenchmarks();
  driftlight::bench::results().print();
  return 0;
}
