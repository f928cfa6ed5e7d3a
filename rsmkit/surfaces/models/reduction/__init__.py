"""Terms left out where runs do not speak for them, step by step."""
