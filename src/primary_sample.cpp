// SPDX-License-Identifier: Apache-2.0
#include "primary_sample.h"

#include <algorithm>
#include <cmath>

namespace driftlight {

double small_step(const PrimaryOptions& options, Rng& rng) {
  const double ratio = std::log(options.step_max / options.step_min);
  const double step = options.step_max * std::exp(-ratio * rng.uniform());
  return rng.uniform() < 0.5 ? step : -step;
}

double moved(double u, const PrimaryOptions& options, Rng& rng) {
  return wrapped(u + small_step(options, rng));
}

double wrapped(double u) { return std::clamp(u - std::floor(u), 0x1p-33, 1.0 - 0x1p-33); }

void PrimarySample::propose(Proposal proposal) {
  ++mutations_;
  show(proposal);
}

void PrimarySample::show(Proposal proposal) {
  proposal_ = proposal;
  next_ = 0;
}

void PrimarySample::accept() {
  ++time_;
  for (Coordinate& c : coordinates_) {
    if (c.first.mutation != mutations_) continue;
    c.value = proposal_ == Proposal::Large ? c.first.value : wrapped(c.value + c.first.value);
    c.time = time_;
  }
  if (proposal_ == Proposal::Large) last_large_time_ = time_;
}

/// All coordinates go along at once: what follows later does so by steps of the usual size.
void PrimarySample::accept_second() {
  for (Coordinate& c : coordinates_) {
    if (c.time < last_large_time_) continue;
    follow(c);
    c.value = wrapped(c.value + second_step(c));
    ++c.time;
  }
  ++time_;
}

void PrimarySample::follow(Coordinate& c) {
  for (; c.time < time_; ++c.time) c.value = moved(c.value, options_, rng_);
}

double PrimarySample::first_step(Coordinate& c) {
  if (c.first.mutation != mutations_) c.first = {small_step(options_, rng_), mutations_};
  return c.first.value;
}

double PrimarySample::second_step(Coordinate& c) {
  if (c.second.mutation != mutations_)
    c.second = {options_.delayed_rejection.second_scale * small_step(options_, rng_), mutations_};
  return c.second.value;
}

double PrimarySample::next() {
  const bool exists = next_ < coordinates_.size();
  if (!exists) coordinates_.emplace_back();
  Coordinate& c = coordinates_[next_++];
  // What nobody has asked for since it was drawn is uniform, however often it would have moved.
  if (!exists || c.time < last_large_time_) {
    c.value = rng_.uniform();
    c.time = time_;
  }
  if (proposal_ == Proposal::Large) {
    if (c.first.mutation != mutations_) c.first = {rng_.uniform(), mutations_};
    return c.first.value;
  }
  follow(c);
  switch (proposal_) {
    case Proposal::Small:
      return wrapped(c.value + first_step(c));
    case Proposal::Second:
      return wrapped(c.value + second_step(c));
    case Proposal::Ghost:
      return wrapped(c.value + first_step(c) + second_step(c));
    case Proposal::None:
    case Proposal::Large:
      break;
  }
  return c.value;
}

}  // namespace driftlight
