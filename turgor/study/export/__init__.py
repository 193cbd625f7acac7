"""A case as a complete model of another program: CalculiX and Abaqus (.inp), FEBio (.feb)."""
