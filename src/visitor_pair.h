// SPDX-License-Identifier: Apache-2.0
/// Two visitors in one walk. WalkVisitor<T> stands for none.
#pragma once

#include <utility>

#include "driftlight/walk.h"

namespace driftlight {

/// Passes every event on to both. `depart`, which may change the ray, is for who derives from this.
template <Scalar T, class First, class Second>
struct VisitorPair : WalkVisitor<T> {
  First first;
  Second second;

  explicit VisitorPair(First a = {}, Second b = {}) : first(std::move(a)), second(std::move(b)) {}

  void sensor(const PerspectiveCamera& camera, const Vec3<T>& v) {
    first.sensor(camera, v);
    second.sensor(camera, v);
  }
  void position(const Shape& shape, const Vec3<T>& p) {
    first.position(shape, p);
    second.position(shape, p);
  }
  void scatter(const ScatterEvent<T>& e) {
    first.scatter(e);
    second.scatter(e);
  }
  void delta(const ScatterEvent<T>& e) {
    first.delta(e);
    second.delta(e);
  }
  void connect(const ScatterEvent<T>& e) {
    first.connect(e);
    second.connect(e);
  }
  void hit(const AreaEmitter& emitter, const T& cosine, const T& r2) {
    first.hit(emitter, cosine, r2);
    second.hit(emitter, cosine, r2);
  }
  void environment(const Emitter& emitter, const Vec3<T>& v) {
    first.environment(emitter, v);
    second.environment(emitter, v);
  }
  void area_connection(const AreaEmitter& emitter, const T& cosine, const T& r2) {
    first.area_connection(emitter, cosine, r2);
    second.area_connection(emitter, cosine, r2);
  }
  void point_connection(const PointEmitter& emitter, const T& r2) {
    first.point_connection(emitter, r2);
    second.point_connection(emitter, r2);
  }
};

}  // namespace driftlight
