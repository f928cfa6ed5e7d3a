"""What the air does at the wall: boundary layer, friction, heat."""
