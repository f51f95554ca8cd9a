"""The page: a running or recorded grid in a browser, to be watched, attacked and steered (docs/page.md)."""
