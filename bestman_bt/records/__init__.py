"""One record of a run: its events, their writer, the reader of run folders, and exports of the records."""
