"""The derivation: SymPy formulas, written once, and the C emitted from them.

``python -m derive`` writes ``generated/``; ``python -m derive --check`` compares.
"""
