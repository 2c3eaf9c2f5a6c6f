// SPDX-License-Identifier: Apache-2.0
#include "primary_sample.h"

#include <algorithm>
#include <cmath>

namespace driftlight {

double moved(double u, const PrimaryOptions& options, Rng& rng) {
  const double ratio = std::log(options.step_max / options.step_min);
  const double step = options.step_max * std::exp(-ratio * rng.uniform());
  return wrapped(rng.uniform() < 0.5 ? u + step : u - step);
}

double wrapped(double u) { return std::clamp(u - std::floor(u), 0x1p-33, 1.0 - 0x1p-33); }

void PrimarySample::propose(bool large) {
  ++time_;
  large_ = large;
  next_ = 0;
}

void PrimarySample::accept() {
  if (large_) last_large_time_ = time_;
}

void PrimarySample::reject() {
  for (Coordinate& c : coordinates_) {
    if (c.time != time_) continue;
    c.value = c.old_value;
    c.time = c.old_time;
  }
  --time_;
}

double PrimarySample::next() {
  const bool exists = next_ < coordinates_.size();
  if (!exists) coordinates_.emplace_back();
  Coordinate& c = coordinates_[next_++];
  if (exists && c.time == time_) return c.value;
  // What nobody has asked for since it was drawn is uniform, however often it would have moved.
  if (!exists || c.time < last_large_time_) {
    c.value = rng_.uniform();
    c.time = time_ > 0 ? time_ - 1 : 0;
  }
  c.old_value = c.value;
  c.old_time = c.time;
  if (large_)
    c.value = rng_.uniform();
  else
    for (; c.time < time_; ++c.time) c.value = moved(c.value, options_, rng_);
  c.time = time_;
  return c.value;
}

}  // namespace driftlight
