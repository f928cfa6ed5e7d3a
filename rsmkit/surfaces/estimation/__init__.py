"""What every kind of surface is estimated with."""
