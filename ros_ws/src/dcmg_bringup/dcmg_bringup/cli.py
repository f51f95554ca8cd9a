"""The `dcmg` command under its former name: `python -m dcmg_bringup.cli`. It lives in `dcmg.cli`."""

from dcmg.cli import app, main

__all__ = ["app", "main"]

if __name__ == "__main__":
    main()
