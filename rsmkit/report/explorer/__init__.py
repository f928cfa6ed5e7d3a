"""The explorer: one page that holds the whole study."""
