#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Installs the dependencies, builds the renderer and renders a scene of glossy surfaces for 50
# seconds. The images go to build/demo.
set -euo pipefail
cd "$(dirname "$0")"

.ci/install-dependencies
cmake --preset release
cmake --build --preset release --target driftlight-cli
mkdir -p build/demo
build/release/driftlight render scenes/glossy_chain.xml --time 50 \
  -o build/demo/glossy_chain.exr -o build/demo/glossy_chain.png
echo "The picture is build/demo/glossy_chain.png (and .exr, with its full range)."
