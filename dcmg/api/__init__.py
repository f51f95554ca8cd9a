"""What `import dcmg` gives: thin over `dgu_sim`, `monitor` and `bags`, and forgiving about what arrays look like."""
