"""The commands: one thin typed function per study."""
