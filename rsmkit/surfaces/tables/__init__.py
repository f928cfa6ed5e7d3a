"""Tables of finished experiments: columns, coding, counts, mixtures, and one surface per response."""
