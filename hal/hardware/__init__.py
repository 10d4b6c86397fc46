"""Real robots: one clock, one stop, one watchdog and one set of limits over the controllers of several vendors."""
