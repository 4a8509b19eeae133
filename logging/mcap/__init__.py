"""The MCAP file: its records written, and read in file order, bounded and checked, also behind damage."""
