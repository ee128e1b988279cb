"""Effects of the virtual rig."""
