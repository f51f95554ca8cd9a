"""The `dcmg` command: runs, simulations, replays, experiments and attacks by hand."""
