"""Outside data, in and out: files replaced in one step, TOML tables, JSON documents, CSV tables."""
