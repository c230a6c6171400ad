"""A variable-structure multiple-model tracker, patent application CN101894278, 2010.

So far `imm`, its filter, which knows nothing of bodies: any models of any state can be given to it.
"""
