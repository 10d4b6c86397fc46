"""Universal Robots through ur-rtde (extra ``ur``), which runs in a process of its own while connected."""
