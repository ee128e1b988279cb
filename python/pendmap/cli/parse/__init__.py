"""Options and arguments of commands: their types, groups, and what several share."""
