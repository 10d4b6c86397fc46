"""Watching executors from outside: their events, the live page, Groot2. Executors are met only through sockets."""
