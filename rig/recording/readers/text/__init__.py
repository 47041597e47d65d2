"""Text: how a file is laid out, its headings, numbers, stamps, and what stands for no reading."""
