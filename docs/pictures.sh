#!/bin/sh
# Makes the pictures of README and docs anew, each by the command that its page names. Needs Chromium for that of the report.
set -eu
cd "$(dirname "$0")/.."
PATH=$PWD/.venv/bin:$PATH
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT

dcmg simulate gallo_six_dgu --out "$made/run" >"$made/log" 2>&1
cp "$made/run/plots/residuals.png" docs/images/run.png
dcmg simulate team_six_dgu --out "$made/team" >"$made/log" 2>&1
cp "$made/team/plots/team.png" docs/images/team.png
dcmg simulate reconstruct_six_dgu --out "$made/reconstruct" --no-plots >"$made/log" 2>&1
dcmg reconstruct "$made/reconstruct/bag" --link 1-2 --noise-std 0.001,0.001,0.0001 --out "$made/reconstruct" >"$made/log"
cp "$made/reconstruct/reconstruction_1-2.png" docs/images/reconstruction.png
dcmg simulate gallo_six_dgu_combined --out "$made/combined" --no-plots >"$made/log" 2>&1
dcmg report "$made/combined/bag" --out "$made/report" >"$made/log"
chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --blink-settings=preferredColorScheme=1 --window-size=1280,900 \
  --virtual-time-budget=8000 --screenshot="$PWD/docs/images/report.png" "file://$made/report/report.html" 2>"$made/log"
dcmg measure roc --out "$made" >"$made/log"
cp "$made/roc_joint.png" docs/images/roc_joint.png
dcmg paper which-observer --out "$made" >"$made/log"
cp "$made/which_observer.png" docs/images/which_observer.png
python -m dcmg.papers.noise_methods "$made" >"$made/log"
cp "$made/noise_methods.png" docs/images/noise_methods.png
python -m tests.dcmg.page.pictures docs/images >"$made/log"
