// SPDX-License-Identifier: Apache-2.0
/// Tests of means: Student's, Welch's, and Sidak's correction for many of them.
#pragma once

#include "student.h"

namespace driftlight::test {

using driftlight::Moments;
using driftlight::sidak;
using driftlight::student_p_value;

/// Two-sided p-value of Welch's test that two means are equal; the variances may differ.
double welch_p_value(const Moments& a, const Moments& b);

/// Two-sided p-value of a standard normal deviate.
double normal_p_value(double z);

}  // namespace driftlight::test
