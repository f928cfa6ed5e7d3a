"""The local searches that end it."""
