"""A study: the file its user wrote, and the folder its stages fill."""
