"""What a task may ask for, a kind in a file: its checks, its entries, its judgement."""
