"""What a remote is, whatever line leads to it: its tables, its parameters, built-in facts of two old ones."""
