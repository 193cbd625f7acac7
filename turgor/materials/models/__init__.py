"""One strain-energy model per file; a file put here is found by itself."""
