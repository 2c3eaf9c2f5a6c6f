// SPDX-License-Identifier: Apache-2.0
/// Two visitors in one walk. WalkVisitor<T> stands for none.
#pragma once

#include <tuple>
#include <utility>

#include "driftlight/walk.h"

namespace driftlight {

/// Passes every event on to both. Those that may change the walk, and where it is, are for who
/// derives from this.
template <Scalar T, class First, class Second>
struct VisitorPair : WalkVisitor<T> {
  First first;
  Second second;

  explicit VisitorPair(First a = {}, Second b = {}) : first(std::move(a)), second(std::move(b)) {}
  /// Each from its arguments, where it is.
  template <class... A, class... B>
  VisitorPair(std::piecewise_construct_t, std::tuple<A...> a, std::tuple<B...> b)
      : first(std::make_from_tuple<First>(std::move(a))),
        second(std::make_from_tuple<Second>(std::move(b))) {}

  void lens(const Camera& camera, const Vec3<T>& p) {
    first.lens(camera, p);
    second.lens(camera, p);
  }
  void sensor(const Camera& camera, const Vec3<T>& v, const Vec3<T>& lens) {
    first.sensor(camera, v, lens);
    second.sensor(camera, v, lens);
  }
  void depart_parallel(Ray<T>& ray) {
    first.depart_parallel(ray);
    second.depart_parallel(ray);
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
  void blurred_hit(const BlurredAreaEmitter& emitter, const Ray<T>& ray) {
    first.blurred_hit(emitter, ray);
    second.blurred_hit(emitter, ray);
  }
  void area_connection(const AreaEmitter& emitter, const T& cosine, const T& r2) {
    first.area_connection(emitter, cosine, r2);
    second.area_connection(emitter, cosine, r2);
  }
  void point_connection(const Emitter& emitter, const Vec3<T>& wo, const T& r2) {
    first.point_connection(emitter, wo, r2);
    second.point_connection(emitter, wo, r2);
  }
  void directional_connection(const DirectionalEmitter& emitter) {
    first.directional_connection(emitter);
    second.directional_connection(emitter);
  }
  void area_emission(const AreaEmitter& emitter, const Vec3<T>& normal, const Vec3<T>& v) {
    first.area_emission(emitter, normal, v);
    second.area_emission(emitter, normal, v);
  }
  void emission_texture(const Texture& texture, const Vec2<T>& uv) {
    first.emission_texture(texture, uv);
    second.emission_texture(texture, uv);
  }
  void point_emission(const Emitter& emitter, const Vec3<T>& v) {
    first.point_emission(emitter, v);
    second.point_emission(emitter, v);
  }
  void directional_emission(const DirectionalEmitter& emitter, const Vec3<T>& offset) {
    first.directional_emission(emitter, offset);
    second.directional_emission(emitter, offset);
  }
  void environment_emission(const Emitter& emitter, const Vec3<T>& offset, const Vec3<T>& v) {
    first.environment_emission(emitter, offset, v);
    second.environment_emission(emitter, offset, v);
  }
  void light_scatter(const ScatterEvent<T>& e) {
    first.light_scatter(e);
    second.light_scatter(e);
  }
  void light_delta(const ScatterEvent<T>& e) {
    first.light_delta(e);
    second.light_delta(e);
  }
  void light_connect(const ScatterEvent<T>& e) {
    first.light_connect(e);
    second.light_connect(e);
  }
  void joined(const T& r2) {
    first.joined(r2);
    second.joined(r2);
  }
};

}  // namespace driftlight
