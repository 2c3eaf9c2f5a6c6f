// SPDX-License-Identifier: Apache-2.0
#include "cli/path_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cli/gradient_report.h"
#include "driftlight/contribution.h"
#include "driftlight/path_class.h"

namespace driftlight::cli {

namespace {

std::string vector_text(const Vec3d& v) {
  return fmt::format("{:>25.17g} {:>25.17g} {:>25.17g}", v.x(), v.y(), v.z());
}

const char* verdict_text(Verdict verdict) {
  switch (verdict) {
    case Verdict::Agrees:
      return "agrees";
    case Verdict::Wrong:
      return "WRONG";
    case Verdict::Kink:
      return "kink";
    case Verdict::Undecided:
      return "undecided";
  }
  return "";
}

/// A line for each vertex, and one for the end.
class Describer : public WalkVisitor<double> {
 public:
  Describer(const Scene& scene, const PathTopology& topology)
      : scene_(scene), topology_(topology) {}

  std::string text() const {
    std::string text;
    for (std::size_t k = 0; k < topology_.scatter_count; ++k) text += vertices_.at(k);
    return text + end_;
  }

  void scatter(const ScatterEvent<double>& e) { add(e); }
  void connect(const ScatterEvent<double>& e) { add(e); }
  void delta(const ScatterEvent<double>& e) { add(e); }
  void vertex(int k) { index_ = static_cast<std::size_t>(k); }
  void light_scatter(const ScatterEvent<double>& e) { add(e); }
  void light_delta(const ScatterEvent<double>& e) { add(e); }
  void light_connect(const ScatterEvent<double>& e) { add(e); }
  void light_side() {
    end(fmt::format("emits; the last {} vertices are the light side", topology_.light_count));
  }
  void hit(const AreaEmitter&, const double&, const double&) {
    const Hit& at = topology_.vertices[topology_.scatter_count].hit;
    end(fmt::format("hits {}, primitive {}", shape_text(at.shape), at.primitive));
  }
  void environment(const Emitter&, const Vec3d&) { end("leaves the scene"); }
  void area_connection(const AreaEmitter& light, const double&, const double&) {
    end("connects to a point on " + shape_text(light.shape));
  }
  void point_connection(const Emitter&, const Vec3d&, const double&) {
    end("connects to the point");
  }
  void directional_connection(const DirectionalEmitter&) { end("leaves toward the light"); }

 private:
  std::string shape_text(std::uint32_t shape) const {
    return fmt::format("shape {} ({})", shape, kind_of(scene_.shapes()[shape]));
  }
  void add(const ScatterEvent<double>& e) {
    const Hit& at = topology_.vertices[index_].hit;
    vertices_.at(index_) = fmt::format(
        "  {:>2}  {}, primitive {}: {} (bsdf {}), {}, at {}\n", index_ + 1, shape_text(at.shape),
        at.primitive, kind_of(e.bsdf), &e.bsdf - scene_.bsdfs().data(),
        e.scattering == Scattering::Reflection ? "reflection" : "transmission",
        vector_text(e.at.p));
  }
  void end(const std::string& how) {
    end_ = fmt::format("  end {}: emitter {} ({})\n", how, topology_.emitter,
                       kind_of(scene_.emitters()[topology_.emitter]));
  }

  const Scene& scene_;
  const PathTopology& topology_;
  std::size_t index_ = 0;
  std::array<std::string, kMaxPathLength> vertices_;
  std::string end_;
};

std::string coordinates_text(const PathSampler::Sample& path) {
  std::string text = "coordinates\n";
  for (int k = 0; k < path.topology.block_count; ++k) {
    const bool point = k == path.topology.point_block();
    text += fmt::format("  {:>2}  {:<9} {}\n", k, point ? "point" : "direction",
                        vector_text(path.coordinates(k)));
  }
  return text;
}

std::string gradient_text(const PathCheck& check) {
  std::string text = fmt::format("{:<6} {:>25} {:>25} {:>25} {:>9} {:>9} {:<9} {:>25}\n", "grad U",
                                 "jets", "hand", "Ridders", "+-", "relative", "", "Q_jj");
  for (std::size_t j = 0; j < check.gradient.size(); ++j) {
    const DerivativeCheck& c = check.gradient[j];
    const auto i = static_cast<Eigen::Index>(j);
    text += fmt::format(
        "  {:>2}   {:>25.17g} {:>25.17g} {:>25.17g} {:>9.1e} {:>9.1e} {:<9} {:>25.17g}\n", j,
        check.gradient_jets[i], check.gradient_hand[i], c.numeric.value, c.numeric.error, c.error,
        verdict_text(c.verdict), check.q(i, i));
  }
  return text;
}

/// The coordinate in which a residual's row is worst: its errors are the largest parts of their
/// tolerances.
struct WorstEntry {
  Eigen::Index column = 0;
  double part = -1;
};

double hand_error(const PathCheck& check, Eigen::Index row, Eigen::Index j) {
  return std::abs(check.jacobian_hand(row, j) - check.jacobian_jets(row, j)) /
         std::sqrt(check.q(j, j));
}
const DerivativeCheck& entry(const PathCheck& check, Eigen::Index row, Eigen::Index j) {
  return check.jacobian[static_cast<std::size_t>(j)][static_cast<std::size_t>(row)];
}

WorstEntry worst_entry(const PathCheck& check, Eigen::Index row) {
  WorstEntry worst;
  for (Eigen::Index j = 0; j < check.jacobian_jets.cols(); ++j) {
    const DerivativeCheck& c = entry(check, row, j);
    // What does not agree comes first.
    const double part = std::max(hand_error(check, row, j) / tolerance(Quantity::JacobianHand),
                                 c.error / tolerance(Quantity::JacobianRidders)) +
                        (c.verdict == Verdict::Agrees ? 0.0 : 1.0);
    if (part > worst.part) worst = {j, part};
  }
  return worst;
}

/// A line for each residual, with its worst coordinate; an arrow at the worst of all.
std::string residuals_text(const PathCheck& check) {
  std::string text =
      fmt::format("{:<12} {:>5} {:>25} {:>25} {:>25} {:>9} {:>9} {:>9}\n", "sqrt(w)/3 dr", "coord",
                  "jets", "hand", "Ridders", "+-", "hand", "Ridders");
  const Eigen::Index count = check.jacobian_jets.rows();
  if (check.jacobian.empty() || check.jacobian_hand.rows() != count)
    return text + "  the numbers of residuals differ\n";
  std::vector<WorstEntry> worst;
  for (Eigen::Index r = 0; r < count; ++r) worst.push_back(worst_entry(check, r));
  const auto largest = std::max_element(
      worst.begin(), worst.end(), [](const auto& a, const auto& b) { return a.part < b.part; });
  for (auto w = worst.begin(); w != worst.end(); ++w) {
    const Eigen::Index r = w - worst.begin();
    const DerivativeCheck& c = entry(check, r, w->column);
    text += fmt::format(
        "{} {:>3}       {:>5} {:>25.17g} {:>25.17g} {:>25.17g} {:>9.1e} {:>9.1e} {:>9.1e} {}\n",
        w == largest ? "->" : "  ", r, w->column, check.jacobian_jets(r, w->column),
        check.jacobian_hand(r, w->column), c.numeric.value, c.numeric.error,
        hand_error(check, r, w->column), c.error, verdict_text(c.verdict));
  }
  return text;
}

std::string divergence_text(const PathCheck& check) {
  std::string text =
      fmt::format("{:<10} {:>25} {:>25}\n", "div Q^-1", "differences", "jets of jets");
  for (Eigen::Index j = 0; j < check.divergence.size(); ++j)
    text += fmt::format("  {:>2}       {:>25.17g} {:>25.17g}\n", j, check.divergence[j],
                        check.exact_divergence[j]);
  return text;
}

}  // namespace

std::string path_text(const Scene& scene, const PathSampler::Sample& path, const PathCheck& check) {
  Describer describer(scene, path.topology);
  walk<double>(scene, path.topology, path.coordinates, describer);
  std::string text = path_class(scene, path.topology, path.coordinates) + "\n";
  text += fmt::format("log f = {:.17g}\n",
                      contribution(scene, path.topology, path.coordinates).log_target);
  text += "vertices\n" + describer.text() + coordinates_text(path) + gradient_text(check) +
          residuals_text(check) + divergence_text(check) + "relative errors\n";
  for (const Quantity quantity : kQuantities) {
    const Comparison& c = check[quantity];
    text += fmt::format(
        "  {:<32} {:>9.2e}  (tolerance {:.0e}; {} compared, {} at kinks, {} undecided)\n",
        title(quantity), c.error, tolerance(quantity), c.compared, c.kinks, c.undecided);
  }
  return text;
}

}  // namespace driftlight::cli
