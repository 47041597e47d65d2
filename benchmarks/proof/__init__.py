"""The proof on rigs whose truth is known: what stays of every effect, and what becomes of wrong names."""
