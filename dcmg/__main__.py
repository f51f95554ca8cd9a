"""`python -m dcmg`: the `dcmg` command."""

from dcmg.cli import main

main()
