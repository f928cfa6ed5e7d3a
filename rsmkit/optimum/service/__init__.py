"""What responses do under the laws, as objectives and constraints of a search."""
