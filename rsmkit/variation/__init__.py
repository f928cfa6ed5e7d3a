"""What varies in service, how much of it arrives in the responses, and whether that is good enough."""
