"""Tables of numbers with names and units, from files and from memory."""
