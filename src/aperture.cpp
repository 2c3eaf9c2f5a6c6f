// SPDX-License-Identifier: Apache-2.0
#include "driftlight/aperture.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "driftlight/walk.h"

namespace driftlight {
namespace {

// ---- Segments ---------------------------------------------------------------------------------

struct Segment {
  Vec3d from;
  Vec3d normal;      ///< geometric, of the surface it leaves; the optical axis at the sensor
  Vec3d v;           ///< unit
  Vec3d end_normal;  ///< of the surface it ends on; v where that has none
  double length;
  bool determined = false;  ///< by a delta lobe
  bool parallel = false;    ///< of an orthographic sensor: its block moves `from` alone
};

/// Records the segments of a path without a light side.
class SegmentRecorder : public WalkVisitor<double> {
 public:
  SegmentRecorder(const Scene& scene, const PathTopology& topology)
      : scene_(scene), topology_(topology) {}

  int count() const { return count_; }
  const Segment& operator[](int k) const { return segments_[static_cast<std::size_t>(k)]; }

  void depart(const Ray<double>& ray, const Vec3d& normal) {
    begin(ray.origin, normal, ray.direction);
    segments_[static_cast<std::size_t>(count_ - 1)].determined = delta_;
    delta_ = false;
  }
  void depart_parallel(const Ray<double>& ray) {
    begin(ray.origin, ray.direction, ray.direction);
    segments_[static_cast<std::size_t>(count_ - 1)].parallel = true;
  }
  const Camera& camera() const { return scene_.camera(); }
  void scatter(const ScatterEvent<double>& e) { end(e.at.p, e.at.n_g); }
  void delta(const ScatterEvent<double>& e) {
    end(e.at.p, e.at.n_g);
    delta_ = true;
  }
  void connect(const ScatterEvent<double>& e) {
    end(e.at.p, e.at.n_g);
    begin(e.at.p, e.at.n_g, e.wo);
  }
  void position(const Shape& shape, const Vec3d& p) {
    shape_ = &shape;
    point_ = p;
  }
  void hit(const AreaEmitter&, const double&, const double&) {
    const Segment& last = segments_[static_cast<std::size_t>(count_ - 1)];
    const Hit& at = topology_.vertices[topology_.scatter_count].hit;
    end(point_, scene_.interact<double>(at, {last.from, last.v}).n_g);
  }
  void area_connection(const AreaEmitter&, const double&, const double&) {
    end(point_, emitter_normal(*shape_, point_));
  }
  void point_connection(const Emitter&, const Vec3d& wo, const double& r2) {
    end_after(std::sqrt(r2), wo);
  }
  void environment(const Emitter&, const Vec3d& v) { end_after(beyond(), v); }
  void directional_connection(const DirectionalEmitter& emitter) {
    end_after(beyond(), -emitter.direction);
  }

 private:
  /// Longer than any segment in the scene.
  double beyond() const { return 4.0 * scene_.radius(); }
  void begin(const Vec3d& from, const Vec3d& normal, const Vec3d& v) {
    Segment& segment = segments_[static_cast<std::size_t>(count_++)];
    segment.from = from;
    segment.normal = normal;
    segment.v = v;
    segment.determined = false;
    segment.parallel = false;
  }
  void end(const Vec3d& p, const Vec3d& normal) {
    const Segment& segment = segments_[static_cast<std::size_t>(count_ - 1)];
    end_after((p - segment.from).dot(segment.v), normal);
  }
  void end_after(double length, const Vec3d& normal) {
    Segment& segment = segments_[static_cast<std::size_t>(count_ - 1)];
    segment.length = length;
    segment.end_normal = normal;
  }

  const Scene& scene_;
  const PathTopology& topology_;
  std::array<Segment, kMaxPathLength + 1> segments_;
  const Shape* shape_ = nullptr;
  Vec3d point_ = Vec3d::Zero();
  int count_ = 0;
  bool delta_ = false;
};

// ---- Probes -----------------------------------------------------------------------------------

/// The ladder of slopes, from the widest down.
constexpr int kRungs = 32;
constexpr double kWidest = 0.5;
constexpr double kStep = 0.866;
constexpr std::array<double, kRungs> kSlopes = [] {
  std::array<double, kRungs> slopes{};
  double slope = kWidest;
  for (double& s : slopes) {
    s = slope;
    slope *= kStep;
  }
  return slopes;
}();
/// A probe is stopped if it ends before this part of its reach.
constexpr double kStopped = 0.95;
/// What stops it at the edge is an occluder if it stands between these parts of the reach. Beyond
/// them a continuous surface ends there: of the two at the ends of the segment, or next to them.
constexpr double kNearest = 0.01;
constexpr double kFarthest = 0.9;
/// Least reach of a probe, in lengths of the segment.
constexpr double kShortest = 0.8;

/// Where a probe ray has been stopped for the first time, seen from the segment.
struct Edge {
  double slope;
  double nearness;  ///< 1 / distance along the segment
};

/// The probes of one segment.
class Probes {
 public:
  Probes(const Scene& scene, const Segment& segment)
      : scene_(scene),
        segment_(segment),
        from_(scene.leave(segment.from, segment.normal, segment.v)) {}

  /// The edge toward the unit azimuth e from the free direction v + center, if there is one.
  std::optional<Edge> edge(const Vec3d& center, const Vec3d& e) const {
    const auto offset = [&](int rung) { return Vec3d(center + slope(rung) * e); };
    int stopped = 0;
    while (stopped < kRungs && !is_admitted(offset(stopped))) ++stopped;
    if (stopped == kRungs || !is_stopped(offset(stopped))) return std::nullopt;
    int open = kRungs;  // slope 0
    while (open - stopped > 1) {
      const int middle = (open + stopped) / 2;
      (is_stopped(offset(middle)) ? stopped : open) = middle;
    }
    const std::optional<double> distance = distance_to_occluder(offset(stopped));
    if (!distance) return std::nullopt;
    const double inner = open < kRungs ? slope(open) : kStep * slope(stopped);
    return Edge{std::sqrt(inner * slope(stopped)), 1.0 / *distance};
  }

 private:
  static double slope(int rung) { return kSlopes[static_cast<std::size_t>(rung)]; }

  /// The probe leaves the surface on the side of the segment, and sees nearly as far: one that
  /// comes to the plane of the end much earlier would pass before an occluder.
  bool is_admitted(const Vec3d& offset) const {
    const double cosine = segment_.normal.dot(segment_.v);
    const bool leaves = (cosine + segment_.normal.dot(offset)) * cosine > 0.0;
    return leaves && reach(offset) > kShortest * segment_.length;
  }

  /// From the segment's start to the plane of its end, in units of v + offset; at most twice the
  /// segment's length, for probes that run along that plane.
  double reach(const Vec3d& offset) const {
    const double cosine = segment_.end_normal.dot(segment_.v);
    const double ratio = 1.0 + segment_.end_normal.dot(offset) / cosine;
    return segment_.length * (ratio > 0.5 ? 1.0 / ratio : 2.0);
  }

  bool is_stopped(const Vec3d& offset) const {
    return scene_.occluded(from_, from_ + kStopped * reach(offset) * (segment_.v + offset));
  }

  /// Of a stopped probe; none if what stops it is no occluder.
  std::optional<double> distance_to_occluder(const Vec3d& offset) const {
    const Vec3d direction = (segment_.v + offset).normalized();
    const Hit hit = scene_.intersect(from_, direction);
    if (!hit.valid()) return std::nullopt;
    const Vec3d p = scene_.interact<double>(hit, {from_, direction}).p;
    const double distance = (p - segment_.from).dot(segment_.v);
    const double part = distance / reach(offset);
    if (!(part > kNearest && part < kFarthest)) return std::nullopt;
    return distance;
  }

  const Scene& scene_;
  const Segment& segment_;
  Vec3d from_;
};

// ---- Widths -----------------------------------------------------------------------------------

/// Grows beyond all bounds as the edge nears the widest slope, so that widths are continuous there.
double free_slope(double s) { return s / std::sqrt(1.0 - s * s / (kWidest * kWidest)); }

/// The free slopes to both sides along an axis.
struct Chord {
  Edge ahead;
  Edge behind;

  double middle() const { return 0.5 * (ahead.slope - behind.slope); }
  double precision() const {
    const double width = free_slope(ahead.slope) + free_slope(behind.slope);
    return 12.0 / (width * width);
  }
  double nearness() const { return 0.5 * (ahead.nearness + behind.nearness); }
};

std::optional<Chord> find_chord(const Probes& probes, const Vec3d& center, const Vec3d& axis) {
  const std::optional<Edge> ahead = probes.edge(center, axis);
  if (!ahead) return std::nullopt;
  const std::optional<Edge> behind = probes.edge(center, -axis);
  if (!behind) return std::nullopt;
  return Chord{*ahead, *behind};
}

/// P from its values p_i = e_i.P e_i along three axes at 0, 60 and 120 degrees:
///   e(phi).P e(phi) = mean + a cos 2 phi + b sin 2 phi,
/// exact for an ellipse and for a slit of any orientation. Eigenvalues that come out negative,
/// where a long window has edges on some axes only, are 0.
void set_rows(const std::array<double, 3>& p, const TangentBasis& basis, Aperture& aperture) {
  const double mean = (p[0] + p[1] + p[2]) / 3.0;
  const double a = (2.0 * p[0] - p[1] - p[2]) / 3.0;
  const double b = (p[1] - p[2]) / std::sqrt(3.0);
  const double amplitude = std::hypot(a, b);
  const double phi = 0.5 * std::atan2(b, a);
  const Vec3d axis = std::cos(phi) * basis.t + std::sin(phi) * basis.b;
  const Vec3d across = std::cos(phi) * basis.b - std::sin(phi) * basis.t;
  aperture.rows[0] = std::sqrt(mean + amplitude) * axis;
  aperture.rows[1] = std::sqrt(std::max(0.0, mean - amplitude)) * across;
}

/// Fills in all but the segment's number; false if the segment is free.
bool find_aperture(const Scene& scene, const Segment& segment, Aperture& aperture) {
  const Probes probes(scene, segment);
  const TangentBasis basis = tangent_basis(segment.v);
  constexpr double kSin60 = 0.86602540378443864676;
  const std::array<Vec3d, 3> axes{basis.t, 0.5 * basis.t + kSin60 * basis.b,
                                  -0.5 * basis.t + kSin60 * basis.b};
  std::optional<Chord> first;
  Vec3d center = Vec3d::Zero();
  int tried = 0;
  while (tried < 3 && !first)
    first = find_chord(probes, center, axes[static_cast<std::size_t>(tried++)]);
  if (!first) return false;
  const Vec3d& along = axes[static_cast<std::size_t>(tried - 1)];
  center += first->middle() * along;
  const Vec3d across = segment.v.cross(along);
  if (const auto chord = find_chord(probes, center, across)) center += chord->middle() * across;
  std::array<double, 3> precision{};
  double sum = 0;
  double weighted = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto chord = find_chord(probes, center, axes[i]);
    if (!chord) continue;
    precision[i] = chord->precision();
    sum += precision[i];
    weighted += precision[i] * chord->nearness();
  }
  if (!(sum > 0.0)) return false;
  aperture.kappa = weighted / sum;
  set_rows(precision, basis, aperture);
  return true;
}

// ---- Rows -------------------------------------------------------------------------------------

/// Inserts a residual row at the end of a stage.
void insert(Linearization& path, int stage, const LocalRow& row) {
  const int at = path.stages[static_cast<std::size_t>(stage)].rows_end;
  for (int i = path.row_count(); i > at; --i) path.rows.row(i) = path.rows.row(i - 1);
  path.rows.row(at) = row;
  for (int k = stage; k < path.stage_count; ++k)
    ++path.stages[static_cast<std::size_t>(k)].rows_end;
}

/// The rows of the apertures of one path.
class ApertureRows {
 public:
  ApertureRows(const PathTopology& topology, const Chart& chart, const SegmentRecorder& segments,
               Linearization& path)
      : topology_(topology), chart_(chart), segments_(segments), path_(path) {}

  void add(const Aperture& aperture) {
    const int k = aperture.segment;
    const bool connects = topology_.ends_in_connection() && k == topology_.scatter_count;
    for (const Vec3d& w : aperture.rows) {
      if (w.isZero(0.0)) continue;
      const int stage = k + topology_.lens_block_count();
      if (connects)
        insert(path_, stage, connection_row(aperture, w / 3.0));
      else
        insert(path_, stage + 1, state_row(k, aperture.kappa * w / 3.0, w / 3.0));
    }
  }

 private:
  /// The row of a.dx + c.dv over the state (xi, omega) of segment k.
  LocalRow state_row(int k, const Vec3d& a, const Vec3d& c) const {
    const Segment& segment = segments_[k];
    const TangentBasis plane = tangent_basis(segment.normal);
    LocalRow row = LocalRow::Zero();
    if (segment.parallel) {
      const Chart::Block& block = chart_.block(0);
      const Camera& camera = segments_.camera();
      row[kSensorColumns.xi] = a.dot(camera.origin_differential(block.point, block.t));
      row[kSensorColumns.xi + 1] = a.dot(camera.origin_differential(block.point, block.b));
      return row;
    }
    row[kSensorColumns.xi] = a.dot(plane.t);
    row[kSensorColumns.xi + 1] = a.dot(plane.b);
    if (segment.determined) {
      const TangentBasis basis = tangent_basis(segment.v);
      row[kSensorColumns.omega] = c.dot(basis.t);
      row[kSensorColumns.omega + 1] = c.dot(basis.b);
    } else {
      const Chart::Block& block = chart_.block(block_of(k));
      row[kSensorColumns.omega] = c.dot(block.t);
      row[kSensorColumns.omega + 1] = c.dot(block.b);
    }
    return row;
  }

  /// The edge from x to y of length r: (1 / r) dy + (kappa - 1 / r) dx across it, with
  /// dx = d - v (n.d) / (n.v), d = dx' + l dv of the segment that arrives at x. A fixed direction
  /// has kappa dx alone.
  LocalRow connection_row(const Aperture& aperture, const Vec3d& w) const {
    const int k = aperture.segment;
    const Segment& edge = segments_[k];
    const Segment& arriving = segments_[k - 1];
    const bool parallel = topology_.end == PathEnd::DirectionalConnection;
    const double inverse = parallel ? 0.0 : 1.0 / edge.length;
    const Vec3d a = (aperture.kappa - inverse) * w;
    const Vec3d& n = edge.normal;
    const Vec3d back = a - n * (a.dot(arriving.v) / n.dot(arriving.v));
    LocalRow row = state_row(k - 1, back, arriving.length * back);
    if (topology_.end == PathEnd::AreaConnection) {
      const Chart::Block& y = chart_.block(topology_.block_count - 1);
      row[kSensorColumns.u] = inverse * w.dot(y.t);
      row[kSensorColumns.u + 1] = inverse * w.dot(y.b);
    }
    return row;
  }

  int block_of(int segment) const {
    int block = topology_.lens_block_count();
    for (int k = 0; k < segment; ++k)
      if (!segments_[k].determined) ++block;
    return block;
  }

  const PathTopology& topology_;
  const Chart& chart_;
  const SegmentRecorder& segments_;
  Linearization& path_;
};

}  // namespace

Apertures find_apertures(const Scene& scene, const PathTopology& topology,
                         const PathCoordinates& coordinates) {
  Apertures apertures;
  if (topology.has_light_side()) return apertures;
  SegmentRecorder segments(scene, topology);
  walk<double>(scene, topology, coordinates, segments);
  for (int k = 1; k < segments.count(); ++k) {
    if (segments[k].determined) continue;
    Aperture aperture;
    aperture.segment = k;
    if (find_aperture(scene, segments[k], aperture)) apertures.add(aperture);
  }
  return apertures;
}

void constrain(const Scene& scene, const PathTopology& topology, const Chart& chart,
               const Apertures& apertures, Linearization& path) {
  if (apertures.count() == 0 || path.stage_count == 0) return;
  SegmentRecorder segments(scene, topology);
  walk<double>(
      scene, topology, [&](int k) { return chart.block(k).point; }, segments);
  ApertureRows rows(topology, chart, segments, path);
  for (int i = 0; i < apertures.count(); ++i) rows.add(apertures[i]);
}

}  // namespace driftlight
