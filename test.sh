#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Installs the dependencies, builds the release and runs all tests. Arguments go to ctest, for
# example: ./test.sh -L fast
set -euo pipefail
cd "$(dirname "$0")"

.ci/install-dependencies
cmake --preset release
cmake --build --preset release
ctest --preset release "$@"
