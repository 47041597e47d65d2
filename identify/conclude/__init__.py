"""From the final fits to the verdict: errors, what is not determined, acceptance, next steps."""
